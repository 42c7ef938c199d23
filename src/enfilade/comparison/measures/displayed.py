"""One frame of a test and of its reference as the display shows them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enfilade.errors import InputError
from enfilade.kernels.tone import display_luminance, srgb_encode
from enfilade.records import F32
from enfilade.viewing import Viewing


@dataclass(frozen=True, eq=False)
class DisplayedPair:
    """A pair of frames after exposure and clipping at black and white.

    Attributes
    ----------
    test, reference : (H, W, 3) float32
        Encoded for an sRGB display, 0..1; not rounded to 8 bits.
    test_cd_m2, reference_cd_m2 : (H, W) float32
        Luminance on the display.
    """

    test: F32
    reference: F32
    test_cd_m2: F32
    reference_cd_m2: F32


def display_pair(test: F32, reference: F32, viewing: Viewing, *, exposure_ev: float = 0.0) -> DisplayedPair:
    """Display a pair of frames.

    Parameters
    ----------
    test, reference : (H, W, 3) float32
        Linear Rec.709, 1 = white at exposure 0.
    viewing
        Its size is that of the frames.
    exposure_ev
        In stops.

    Raises
    ------
    InputError
        A frame has another size, or holds a NaN or an infinity.
    """
    shape = (viewing.height_px, viewing.width_px, 3)
    for name, image in (("test", test), ("reference", reference)):
        if image.shape != shape:
            raise InputError(f"the {name} has shape {image.shape}; the viewing conditions ask for {shape}")
        if not np.isfinite(image).all():
            raise InputError(f"the {name} holds pixels that are NaN or infinite; it can't be compared")
    exposed = (image * np.float32(2.0**exposure_ev) for image in (test, reference))
    of_test, of_reference = (on_screen(image, viewing) for image in exposed)
    return DisplayedPair(of_test[0], of_reference[0], of_test[1], of_reference[1])


def on_screen(exposed: F32, viewing: Viewing) -> tuple[F32, F32]:
    """An exposed image, (H, W, 3) linear Rec.709, encoded for an sRGB display, and its luminance, cd/m2."""
    clipped = np.clip(exposed, 0.0, 1.0)
    luminance = display_luminance(
        clipped, exposure_ev=0.0, peak_cd_m2=viewing.peak_cd_m2, black_cd_m2=viewing.black_cd_m2
    )
    return srgb_encode(clipped), luminance
