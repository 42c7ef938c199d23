"""ColorVideoVDP (Mantiuk et al. 2024): quality of a colour video in JOD, by ``cvvdp`` and PyTorch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from enfilade.comparison.measures.displayed import DisplayedPair
from enfilade.errors import SettingsError
from enfilade.viewing import Viewing

BLACK_LEAST_CD_M2 = 1e-4  # the display model takes a contrast ratio


class ColorVideoVdp:
    """Just objectionable differences: 10 is identical; 1 less is found worse by three of four observers.

    It models colour and flicker, but no eye movements. It measures a sequence as a whole.

    Parameters
    ----------
    viewing

    Raises
    ------
    SettingsError
        ``cvvdp`` is not installed.

    Notes
    -----
    Keeps all frames until the end as half floats, and copies them then: 24 bytes for a pixel of a pair,
    besides the memory of ``cvvdp``.
    """

    name = "cvvdp"

    def __init__(self, viewing: Viewing) -> None:
        try:
            import pycvvdp
            from pycvvdp.display_model import vvdp_display_geometry, vvdp_display_photo_eotf
            from torch import device
        except ImportError as error:
            raise SettingsError(
                f"ColorVideoVDP is not available: {error}; install it with: pip install cvvdp"
            ) from error
        black = max(viewing.black_cd_m2, BLACK_LEAST_CD_M2)
        screen = vvdp_display_photo_eotf(viewing.peak_cd_m2, contrast=viewing.peak_cd_m2 / black, EOTF="sRGB")
        place = vvdp_display_geometry(
            (viewing.width_px, viewing.height_px), ppd=float(viewing.pixels_per_degree)
        )
        self._fps = viewing.fps
        self._metric: Any = pycvvdp.cvvdp(
            display_photometry=screen, display_geometry=place, device=device("cpu"), quiet=True
        )
        self._frames: list[tuple[npt.NDArray[np.float16], npt.NDArray[np.float16]]] = []

    def measure(self, pair: DisplayedPair) -> None:
        """Keep the next frame, which has no value of its own."""
        self._frames.append((pair.test.astype(np.float16), pair.reference.astype(np.float16)))

    def pool(self, values: Sequence[float | None]) -> float:
        """JOD of all frames."""
        del values
        test, reference = (np.stack(frames) for frames in zip(*self._frames, strict=True))
        fps = self._fps if len(test) > 1 else 0.0  # of a single image
        jod, _ = self._metric.predict(test, reference, dim_order="FHWC", frames_per_second=fps)
        return float(jod)
