"""Initial keyframe placement (§4.2, Eq. 6)."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from enfilade.settings import KeyframeSettings, Placement


def place_keyframes(
    speed: npt.NDArray[np.float64], settings: KeyframeSettings, *, spreads_rest: bool = False
) -> list[int]:
    """Place the initial keyframes of one shot.

    Parameters
    ----------
    speed : (N,) float64
        Mean magnitude of the motion vectors of each frame of the shot, in any unit.
    settings
        Spacing Delta, coefficient A, and the rule of placement.
    spreads_rest
        Whether the segments become longer where what is left for a last one is shorter than half of it; not
        those of equal flow.

    Returns
    -------
    list of int
        Rising indices into `speed`, among them the first and the last frame.
    """
    last = len(speed) - 1
    if last <= 0:
        return [0]
    match settings.placement:
        case Placement.UNIFORM:
            inner = list(range(settings.spacing, last + settings.spacing, settings.spacing))
        case Placement.ADAPTED:
            inner = _adapted(speed, settings.spacing, settings.adaptation)
        case Placement.EQUAL_FLOW:
            inner, spreads_rest = _equal_flow(speed, settings.spacing), False
    if spreads_rest and len(inner) > 1 and 2 * (last - inner[-2]) < inner[-1] - inner[-2]:
        inner = [round(k * last / inner[-2]) for k in inner[:-2]]
    return [0, *(k for k in inner if 0 < k < last), last]


def segment_length(flow: float, mean_flow: float, spacing: int, adaptation: float) -> int:
    """Length of a segment after adaptation to its flow (Eq. 6), frames.

    Parameters
    ----------
    flow
        Accumulated flow magnitude over `spacing` frames from the segment's start.
    mean_flow
        The same, averaged over all segments of uniform spacing.
    spacing, adaptation
        Delta and A.
    """
    alpha = (mean_flow - flow) / mean_flow if mean_flow > 0.0 else 0.0
    alpha = min(max(alpha, -adaptation), adaptation)
    return max(round((1.0 + alpha) * spacing), 1)


def _adapted(speed: npt.NDArray[np.float64], spacing: int, adaptation: float) -> list[int]:
    """Adapt the length of each segment to its flow; the last one may go beyond the shot."""
    # Average the flow over segments of uniform spacing.
    last = len(speed) - 1
    flows = [speed[k : k + spacing].sum() for k in range(0, last - spacing + 1, spacing)]
    mean_flow = float(np.mean(flows)) if flows else float(speed.mean()) * spacing

    # Place one keyframe after the other.
    keyframes, at = [], 0
    while at < last:
        ahead = speed[at : at + spacing]
        flow = float(ahead.sum()) * spacing / len(ahead)  # scaled up at the end of the shot
        at += segment_length(flow, mean_flow, spacing, adaptation)
        keyframes.append(at)
    return keyframes


def _equal_flow(speed: npt.NDArray[np.float64], spacing: int) -> list[int]:
    """Split the accumulated flow evenly into as many segments as uniform spacing has.

    The paper's first attempt, which it found worse (§4.2).
    """
    accumulated = np.concatenate([[0.0], np.cumsum(speed[:-1])])
    count = math.ceil((len(speed) - 1) / spacing)
    marks = accumulated[-1] * np.arange(1, count) / count
    return sorted(set(np.searchsorted(accumulated, marks).tolist()))
