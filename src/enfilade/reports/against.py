"""A run beside its reference, frame by frame: what differs, and how much of it a viewer would see."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enfilade.comparison.measures.shown import Shown, shown
from enfilade.errors import ImageError, RunFolderError
from enfilade.kernels.tone import srgb_encode
from enfilade.metric import Aqm, Pursuit, SequenceAqm
from enfilade.records import F32, Flow
from enfilade.reports.seen import SeenFrame, SeenRun
from enfilade.settings import MetricSettings

__all__ = ["Against", "Beside"]

NO_FLOW = (
    "the reference's image flow leads to other frames than this run has before and after, and this run's "
    "files have none: such frames are judged as if nothing moved; render with --output-layers "
    "forward,backward,source"
)


@dataclass(frozen=True, eq=False)
class Beside:
    """A frame beside the same frame of the reference.

    Attributes
    ----------
    difference_percent : (H, W) float32
        Mean over the channels of what differs as the screen is driven (encoded sRGB), percent of white.
    psnr_db : float or None
        Of the same; None where the two are identical.
    jnd : (H, W) float32 or None
        Map of visible differences; None without the metric.
    score_jnd, percent_visible : float or None
    grey : (H, W) float32
        The reference without colours, encoded, 0..1.
    """

    difference_percent: F32
    psnr_db: float | None
    jnd: F32 | None
    score_jnd: float | None
    percent_visible: float | None
    grey: F32


class Against:
    """Sets the frames of a run, in order, beside those of a reference.

    Parameters
    ----------
    test, reference : SeenRun
    has_metric
        Whether the metric judges them: its modern mode, as in ``enfilade compare``; 0.1 s for a frame
        of 320x240.

    Attributes
    ----------
    notes : list of str
        What is odd about the pair.

    Raises
    ------
    RunFolderError
        The two differ in size or have no frame in common.
    """

    def __init__(self, test: SeenRun, reference: SeenRun, *, has_metric: bool) -> None:
        sizes = [f"{s.viewing.width_px}x{s.viewing.height_px}" for s in (test, reference)]
        if sizes[0] != sizes[1]:
            raise RunFolderError(
                f"{test.run.folder} has images of {sizes[0]}, the reference {reference.run.folder} of "
                f"{sizes[1]}; give one of equal size"
            )
        self._test, self._reference = test, reference
        self._index = {reference.numbers[i]: i for i in reference.finished}
        if not self._index.keys() & set(test.numbers):
            raise RunFolderError(
                f"{test.run.folder} and the reference {reference.run.folder} have no frame in common"
            )
        self.notes = _oddities(test, reference)
        self._last: int | None = None  # index of the frame judged last
        self._aqm = _metric(test) if has_metric else None

    def beside(self, frame: SeenFrame) -> Beside | None:
        """Judge the next frame; None where the reference doesn't have it, or it is not antialiased yet.

        Raises
        ------
        ImageError, RunFolderError
            The reference's file is missing or damaged.
        """
        index = self._index.get(frame.number)
        if index is None or frame.is_raw:
            return None
        other = self._reference.frame(index)
        pair = shown(
            frame.color,
            other.color,
            self._test.viewing,
            exposure_ev=self._test.exposure_ev,
            flow=self._flow(frame, other),
        )
        error = np.abs(pair.test - pair.reference)
        squared = float(np.mean(np.square(error), dtype=np.float64))
        jnd, score, visible = self._judged(frame, pair)
        return Beside(
            difference_percent=np.float32(100.0) * error.mean(axis=2),
            psnr_db=-10.0 * float(np.log10(squared)) if squared > 0.0 else None,
            jnd=jnd,
            score_jnd=score,
            percent_visible=visible,
            grey=self._grey(pair),
        )

    def _flow(self, frame: SeenFrame, other: SeenFrame) -> Flow | None:
        """The reference's image flow where it leads to the neighbours that this run's frame has."""
        if other.flow is None or self._test.neighbours(frame.index) == self._reference.neighbours(
            other.index
        ):
            return other.flow or frame.flow
        if frame.flow is None and NO_FLOW not in self.notes:
            self.notes.append(NO_FLOW)
        return frame.flow

    def _judged(self, frame: SeenFrame, pair: Shown) -> tuple[F32 | None, float | None, float | None]:
        if self._aqm is None:
            return None, None, None
        flow, index = pair.flow, frame.index
        is_cut = self._last is None or self._last != index - 1 or self._test.begins_shot(index)
        self._last = index
        found = self._aqm.compare(
            pair.test_cd_m2,
            pair.reference_cd_m2,
            velocity=None if flow is None else self._test.viewing.velocity_deg_s(flow.motion),
            backward_flow_px=flow.backward if flow is not None and flow.has_backward else None,
            is_cut=is_cut,
        )
        return found.jnd, found.score, found.percent_visible

    def _grey(self, pair: Shown) -> F32:
        of = self._test.viewing
        relative = (pair.reference_cd_m2 - np.float32(of.black_cd_m2)) / np.float32(
            of.peak_cd_m2 - of.black_cd_m2
        )
        return srgb_encode(np.clip(relative, 0.0, 1.0).astype(np.float32))


def _metric(test: SeenRun) -> SequenceAqm:
    table = test.identity.get("settings", {}).get("metric", {})
    default = MetricSettings()
    try:
        pursuit = Pursuit(table.get("metering", default.metering.value))
        return SequenceAqm(Aqm.modern(test.viewing, pursuit=pursuit))
    except ValueError as error:
        raise ImageError(f"{test.run.folder}: its settings of the metric can't be used: {error}") from error


def _oddities(test: SeenRun, reference: SeenRun) -> list[str]:
    notes = []
    scenes = [s.identity.get("scene", {}).get("fingerprint") for s in (test, reference)]
    if scenes[0] != scenes[1]:
        notes.append(f"the reference {reference.name} is of another scene, or of another version of it")
    if _has_other_poses(test, reference):
        notes.append(
            f"the reference {reference.name} is of another camera path (its run.json has other poses): "
            "frames of one number may show different views"
        )
    if test.exposure_ev != reference.exposure_ev:
        notes.append(f"both runs are shown at this run's exposure, {test.exposure_ev:+g} stops")
    if not reference.is_finished:
        notes.append(f"the reference {reference.name} is not finished")
    return notes


def _has_other_poses(test: SeenRun, reference: SeenRun) -> bool:
    """Whether two runs say that they saw the same frames from elsewhere."""
    ours, theirs = (s.identity["path"] for s in (test, reference))
    # Of all frames that were selected, so that those of others can't be compared.
    is_told = "poses" in ours and "poses" in theirs and ours["frames"] == theirs["frames"]
    return bool(is_told and ours["poses"] != theirs["poses"])
