"""Two sequences compared frame after frame: steady errors, errors that flicker, one score (§3)."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from enfilade.errors import InputError
from enfilade.metric.aqm import Aqm
from enfilade.metric.comparison import Comparison
from enfilade.metric.inputs import check_map, check_pair
from enfilade.metric.pooling import POOLING_EXPONENT
from enfilade.metric.transient import error_change
from enfilade.records import F32


class SequenceAqm:
    """The metric for sequences: takes their frames in order and keeps the last error.

    In the modern mode the change of the error since the last frame counts besides, followed along the
    motion of the image; in the paper's mode each frame is compared alone.

    Parameters
    ----------
    aqm : Aqm
        The metric.
    """

    def __init__(self, aqm: Aqm) -> None:
        self.aqm = aqm
        self._last: F32 | None = None
        self._forward: F32 | None = None

    def compare(
        self,
        test: F32,
        reference: F32,
        *,
        velocity: F32 | None = None,
        backward_flow_px: F32 | None = None,
        forward_flow_px: F32 | None = None,
        is_cut: bool = False,
    ) -> Comparison:
        """Compare the next frame of both sequences.

        Parameters
        ----------
        test, reference
            As in `Aqm.compare`.
        velocity : (H, W, 2) float32, optional
            Image velocity, deg/s, x to the right and y down. None: from `backward_flow_px`, if that is
            given, at the frame rate of the viewing conditions; else nothing moves.
        backward_flow_px : (H, W, 2) float32, optional
            From each pixel to its surface's place in the last frame, pixels: for an image that
            moves to the right x is negative. None: the surface was at the same pixel.
        forward_flow_px : (H, W, 2) float32, optional
            From each pixel to its surface's place in the next frame, pixels: with it, surfaces that are
            disoccluded in the next frame have no change. None: they count with the error of what
            covered them.
        is_cut : bool
            Whether this frame begins a shot and has no last frame. The first frame always does.

        Returns
        -------
        Comparison
            `steady` and `transient` hold the two kinds of errors; exactly zero when the frames are
            equal and those before were.

        Raises
        ------
        InputError
            As `Aqm.compare`; a flow has the wrong type or shape, or is not finite.
        """
        viewing = self.aqm.viewing
        shape = viewing.height_px, viewing.width_px
        for name, flow in (("backward_flow_px", backward_flow_px), ("forward_flow_px", forward_flow_px)):
            if flow is not None:
                check_map(name, flow, (*shape, 2), None, is_signed=True)
        if backward_flow_px is not None and velocity is None:
            velocity = viewing.velocity_deg_s(-backward_flow_px)
        check_pair(shape, test, reference, velocity, None)
        change = None
        if self.aqm.has_transient:
            error = test - reference
            if self._last is not None and not is_cut:
                change = error_change(error, self._last, backward_flow_px, self._forward)
            self._last, self._forward = error, forward_flow_px
        return self.aqm.compare(test, reference, velocity=velocity, change=change)


def sequence_score(frame_scores: Iterable[float]) -> float:
    """One number for a sequence, JND: the scores of its frames pooled as pixels are.

    (mean over frames of score^3.5)^(1/3.5): the level that, held over all pixels of all frames,
    would pool to the same. It lies between the mean and the worst frame's score, nearer to the
    worst; it is exactly 0 when every frame's score is 0, and then only.

    Parameters
    ----------
    frame_scores : iterable of float
        `Comparison.score` of every frame, JND.

    Raises
    ------
    InputError
        There is no frame.
    """
    scores = np.asarray(list(frame_scores), dtype=np.float64)
    if not scores.size:
        raise InputError("metric: a sequence without frames has no score; compare one frame at least")
    return float(np.mean(scores**POOLING_EXPONENT) ** (1.0 / POOLING_EXPONENT))
