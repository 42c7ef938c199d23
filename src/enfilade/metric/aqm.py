"""The animation quality metric: from two images to a map of visible differences (§3.4, Fig. 6)."""

from __future__ import annotations

from typing import Self

import numpy as np

from enfilade.errors import InputError
from enfilade.metric.comparison import Comparison
from enfilade.metric.inputs import Pair, check_map, check_pair, fill_undefined
from enfilade.metric.masking import MASK_SLOPE
from enfilade.metric.modern import ModernMetric
from enfilade.metric.paper import PaperMetric
from enfilade.metric.sensitivity import coarse_velocity
from enfilade.records import F32, Mask
from enfilade.settings import Pursuit
from enfilade.viewing import Viewing


class Aqm:
    """The animation quality metric for one viewing condition and image size (§3.4), in one of two modes.

    `Aqm.modern` and `Aqm.paper` make it. Filters are computed once and reused from frame to frame. One
    instance serves one thread at a time.

    Parameters
    ----------
    metric : PaperMetric or ModernMetric
        The stages, in their order.
    pursuit : Pursuit
        Eye movement while the image moves.

    Notes
    -----
    Limits: no colour, no fall of acuity away from the gaze. In the paper's mode contrasts are over the mean
    of the whole image, so errors in dark corners of a bright image count less than they look. Cost:
    docs/metric.md has a table; 0.2 to 0.3 s of CPU time for a pair of 640x480, 1.4 to 2.3 s and 400 MiB for
    1920x1080 (`benchmarks/metric.py`).

    Examples
    --------
    >>> import numpy as np
    >>> from enfilade.viewing import Viewing
    >>> grey = np.full((48, 64), 20.0, dtype=np.float32)
    >>> Aqm.paper(Viewing(64, 48)).compare(grey, grey).percent_visible
    0.0
    """

    def __init__(self, metric: PaperMetric | ModernMetric, *, pursuit: Pursuit = Pursuit.BOTH) -> None:
        self._metric = metric
        self.viewing = metric.viewing
        self.pursuit = pursuit

    @classmethod
    def modern(cls, viewing: Viewing, *, pursuit: Pursuit = Pursuit.BOTH) -> Self:
        """The published metric with each stage brought up to later measurements of vision (`metric.modern`).

        Parameters
        ----------
        viewing : Viewing
            Screen, distance and size of the images, any from 1x1 up; `Viewing.cropped` serves for a part
            of the screen.
        pursuit : Pursuit
            Eye movement while the image moves.
        """
        return cls(ModernMetric(viewing), pursuit=pursuit)

    @classmethod
    def paper(
        cls,
        viewing: Viewing,
        *,
        pursuit: Pursuit = Pursuit.BOTH,
        mask_slope: float = MASK_SLOPE,
    ) -> Self:
        """The published metric (`metric.paper`).

        Parameters
        ----------
        viewing, pursuit
            As in `modern`.
        mask_slope : float
            Slope of visual masking, 0 to 1 (`metric.masking`).
        """
        return cls(PaperMetric(viewing, mask_slope=mask_slope), pursuit=pursuit)

    @property
    def has_transient(self) -> bool:
        """Whether errors that change from frame to frame count: in the modern mode."""
        return self._metric.has_transient

    @property
    def bands_cpd(self) -> tuple[tuple[float, float], ...]:
        """Frequencies that each radial band passes, cycles per degree, finest first; the base from 0."""
        density = self.viewing.pixels_per_degree
        return tuple((band.low_cpp * density, band.high_cpp * density) for band in self._metric.bands)

    def compare(
        self,
        test: F32,
        reference: F32,
        *,
        velocity: F32 | None = None,
        valid: Mask | None = None,
        change: F32 | None = None,
    ) -> Comparison:
        """Predict the visible differences between two images, and their probabilities of detection.

        Parameters
        ----------
        test, reference : (H, W) float32
            Luminance on the screen, cd/m2 (`kernels.tone.display_luminance`), 0 or more. The
            reference alone sets contrast and adaptation; otherwise the two are treated alike.
        velocity : (H, W, 2) float32, optional
            Image velocity, deg/s, x to the right and y down: the mean of backward and forward motion.
            None: nothing moves.
        valid : (H, W) bool, optional
            Pixels to compare. Others may hold any value; they are filled from the other image.
        change : (H, W) float32, optional
            Change of test - reference since the last frame, at the same point of the same surface,
            cd/m2 (`metric.transient`); 0 where not valid. None: none. The paper's mode takes none.

        Returns
        -------
        Comparison
            Maps and scores; exactly zero when the images are equal and so is the change.

        Raises
        ------
        InputError
            An array has the wrong type or shape, or valid pixels that are NaN, infinite or
            negative; the message names the array and the first such pixel.
        """
        shape = self.viewing.height_px, self.viewing.width_px
        check_pair(shape, test, reference, velocity, valid)
        if change is not None:
            check_map("change", change, shape, None, is_signed=True)
            if not self.has_transient:
                raise InputError("metric: change is given to the paper's mode, which compares frames alone")
        is_valid = np.ones(shape, dtype=np.bool_) if valid is None else valid
        pair = Pair(
            *fill_undefined(test, reference, is_valid),
            valid=is_valid,
            velocity=None if velocity is None else coarse_velocity(velocity, is_valid),
            change=change,
        )
        return self._metric.compare(pair, self.pursuit.hypotheses)
