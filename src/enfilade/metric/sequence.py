"""Two sequences judged frame after frame: steady errors, errors that flicker, one score (§3)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from enfilade.errors import InputError
from enfilade.metric.aqm import Aqm
from enfilade.metric.comparison import Comparison
from enfilade.metric.eye import Pursuit
from enfilade.metric.inputs import check_map
from enfilade.metric.masking import MASK_SLOPE
from enfilade.metric.options import MetricOptions
from enfilade.metric.pooling import POOLING_EXPONENT
from enfilade.metric.transient import ErrorChange
from enfilade.viewing import Viewing

__all__ = ["SequenceAqm", "sequence_score"]

BoolArray: TypeAlias = npt.NDArray[np.bool_]
Float32Array: TypeAlias = npt.NDArray[np.float32]


class SequenceAqm:
    """The metric for sequences: takes their frames in order and remembers the last error.

    Each frame is judged as `Aqm` does; with the departure ``transient``, what changed in the error
    since the last frame counts besides, followed along the motion of the image.

    Parameters
    ----------
    viewing : Viewing
        Screen, distance, size of the images and frames per second.
    options : MetricOptions, optional
        By default the modern mode.
    pursuit : Pursuit
        What the eye does while the image moves.
    mask_slope : float
        As `Aqm`: of threshold elevation.
    workers : int
        Threads of the FFT.
    has_kernels : bool
        As `Aqm`.

    Raises
    ------
    InputError
        As `Aqm`.
    """

    def __init__(
        self,
        viewing: Viewing,
        *,
        options: MetricOptions | None = None,
        pursuit: Pursuit = Pursuit.BOTH,
        mask_slope: float = MASK_SLOPE,
        workers: int = 1,
        has_kernels: bool = False,
    ) -> None:
        modern = MetricOptions.modern() if options is None else options
        self.aqm = Aqm(
            viewing,
            options=modern,
            pursuit=pursuit,
            mask_slope=mask_slope,
            workers=workers,
            has_kernels=has_kernels,
        )
        self._changes = ErrorChange()

    def judge(
        self,
        test: Float32Array,
        reference: Float32Array,
        *,
        velocity: Float32Array | None = None,
        backward_flow_px: Float32Array | None = None,
        valid: BoolArray | None = None,
        is_cut: bool = False,
    ) -> Comparison:
        """Judge the next frame of both sequences.

        Parameters
        ----------
        test, reference : (H, W) float32
            Luminance on the screen, cd/m2.
        velocity : (H, W, 2) float32, optional
            Image velocity, deg/s, x to the right and y down. None: `backward_flow_px`, if there is
            one, at the frame rate of the viewing conditions; else nothing moves.
        backward_flow_px : (H, W, 2) float32, optional
            From each pixel to where its surface was in the last frame, pixels: for an image that
            moves to the right x is negative. None: the surface was at the same pixel.
        valid : (H, W) bool, optional
            Pixels to judge.
        is_cut : bool
            Whether this frame begins a shot, so that it has no last frame. The first frame always
            does.

        Returns
        -------
        Comparison
            Its `steady` and `transient` parts tell the two kinds of errors apart; exactly zero
            when the frames are equal and those before were.

        Raises
        ------
        InputError
            As `Aqm.compare`; `backward_flow_px` has the wrong type or shape, or is not finite at a
            judged pixel.
        """
        shape = (self.aqm.viewing.height_px, self.aqm.viewing.width_px)
        if backward_flow_px is not None:
            check_map("backward_flow_px", backward_flow_px, (*shape, 2), valid, is_signed=True)
            if velocity is None:
                velocity = self.aqm.viewing.velocity_deg_s(-backward_flow_px)
        self.aqm.check(test, reference, velocity=velocity, valid=valid)
        if is_cut or not self.aqm.options.transient:
            self._changes.forget()
        change = None
        if self.aqm.options.transient:
            change = self._changes.next(test, reference, backward_flow_px, valid)
        return self.aqm.compare(test, reference, velocity=velocity, valid=valid, change=change)


def sequence_score(frame_scores: Iterable[float]) -> float:
    """One number for a sequence, in JND: the scores of its frames pooled as pixels are.

    (mean over frames of score^3.5)^(1/3.5): the level that, held over all pixels of all frames,
    would pool to the same. It lies between the mean and the worst frame's score, nearer to the
    worst. 0 is no difference, 1 one that a viewer who looks for it finds in three of four cases.

    Parameters
    ----------
    frame_scores : iterable of float
        `Comparison.score` of every frame, JND.

    Returns
    -------
    float
        JND; exactly 0 when every frame's score is 0, and then only.

    Raises
    ------
    InputError
        There is no frame.
    """
    scores = np.asarray(list(frame_scores), dtype=np.float64)
    if not scores.size:
        msg = "metric: a sequence without frames has no score; judge one frame at least"
        raise InputError(msg)
    return float(np.mean(scores**POOLING_EXPONENT) ** (1.0 / POOLING_EXPONENT))
