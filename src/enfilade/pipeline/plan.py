"""Everything that can be known of a walkthrough before it is shaded, and what it will cost."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from enfilade.camera.path import Segment
from enfilade.methods.paper import composite, warp_keyframe
from enfilade.monitor import Monitor
from enfilade.pipeline.cost import Costs
from enfilade.pipeline.job import Job
from enfilade.pipeline.rehearsal import forecast_decoupled
from enfilade.pipeline.survey import Survey, survey_path
from enfilade.pipeline.units import segments_of
from enfilade.pipeline.views import Views
from enfilade.pipeline.walkthrough import check_job
from enfilade.records import Keyframe, Shading
from enfilade.renderer import PixelFilter, Purpose, RandomKey, Renderer, why_inseparable

HOLE_PROBES = (0.25, 0.5, 0.75)  # where in a segment holes are looked for
PROBE_PIXELS, PROBE_SPP = 4096, 16  # paths traced to learn what a path costs


@dataclass(frozen=True)
class Plan:
    """What rendering a walkthrough will take, as far as geometry tells.

    Attributes
    ----------
    frames : tuple of int
        Numbers of the frames.
    mean_speed_deg_s, slow_percent, specular_percent : tuple of float
        Of each frame.
    hole_percent : tuple of float or None
        Pixels that neither keyframe sees, in the frames where that was looked for.
    keyframes : tuple of int
        Numbers of the initial keyframes.
    segments : tuple of dict
        ``first``, ``last`` and ``middle`` of each initial segment.
    method : str
    forecast : dict
        Of the method. ``decoupled``: see :func:`~enfilade.pipeline.rehearsal.forecast_decoupled`. The
        others: ``traced_percent`` of all pixels when every specular surface has to be traced, and
        ``traced_percent_least`` when none has; the share of each reason; ``paths`` and ``seconds``
        of tracing for the former. Segments that the metric will split are not foreseen.
    """

    frames: tuple[int, ...]
    mean_speed_deg_s: tuple[float, ...]
    slow_percent: tuple[float, ...]
    specular_percent: tuple[float, ...]
    hole_percent: tuple[float | None, ...]
    keyframes: tuple[int, ...]
    segments: tuple[dict[str, int], ...]
    method: str
    forecast: dict[str, Any]

    def to_dict(self) -> dict[str, Any]:
        """As plain tables, fit for JSON."""
        return asdict(self)


def plan(job: Job, monitor: Monitor, *, is_tried: bool = False) -> Plan:
    """Look at every frame of a path, place the initial keyframes, and estimate the cost.

    Nothing is shaded but a handful of paths, which tell how long one takes; or, by the decoupled method, a
    segment of the path in a small size.

    Parameters
    ----------
    job, monitor
    is_tried
        Let a process of its own load the scene before.

    Raises
    ------
    InputError
        What :func:`~enfilade.pipeline.walkthrough.render` would refuse: the scene, or a setting.
    DeviceError
    """
    check_job(job)
    if is_tried:
        job.check_scene(is_tried=True)
    renderer = job.open_renderer()
    job.check_separable(why_inseparable(renderer))
    views = Views(renderer, job.path, job.viewing, Costs())
    survey = survey_path(views, job.path, job.settings, monitor)
    shots = segments_of(job, survey)
    segments = [segment for shot in shots for segment in shot]
    holes: dict[int, float] = {}
    if job.method == "decoupled":
        forecast = forecast_decoupled(job, shots, monitor)
    elif job.method == "paper":
        holes = _expected_holes(job, views, segments, monitor)
        forecast = _forecast(job, _shares(job, survey, segments, holes), renderer)
    else:
        forecast = _forecast(job, {"keyframes": 100.0}, renderer)

    numbers = job.path.numbers
    keyframes = sorted({s.first for s in segments} | {s.last for s in segments})
    return Plan(
        frames=numbers,
        mean_speed_deg_s=survey.speed_deg_s,
        slow_percent=survey.slow_percent,
        specular_percent=survey.specular_percent,
        hole_percent=tuple(holes.get(frame) for frame in range(len(job.path))),
        keyframes=tuple(numbers[k] for k in keyframes),
        segments=tuple(_numbered(job, segment) for segment in segments),
        method=job.method,
        forecast=forecast,
    )


def _numbered(job: Job, segment: Segment) -> dict[str, int]:
    middle = job.path.middle(segment)
    frames = {
        "first": segment.first,
        "last": segment.last,
        "middle": segment.first if middle is None else middle,
    }
    return {name: job.path.numbers[frame] for name, frame in frames.items()}


def _expected_holes(job: Job, views: Views, segments: list[Segment], monitor: Monitor) -> dict[int, float]:
    """Share of holes at a few frames of each segment, percent, by warping the geometry alone."""
    monitor.stage("holes", len(segments))
    holes: dict[int, float] = {}
    for segment in segments:
        moving = job.path.moving(segment)
        for frame in sorted({moving[int(len(moving) * share)] for share in HOLE_PROBES} if moving else ()):
            holes[frame] = hole_percent(job, views, segment, frame)
        monitor.advance()
    return holes


def hole_percent(job: Job, views: Views, segment: Segment, frame: int) -> float:
    """Share of a frame's pixels that neither keyframe of its segment sees, percent, by geometry alone."""
    ends = [_unshaded(views, end) for end in (segment.first, segment.last)]
    settings = job.settings.warp
    before, after = (warp_keyframe(k, job.path.cameras[frame], settings) for k in ends)
    _, is_hole = composite(
        before,
        after,
        views[frame].geometry,
        progress=job.path.progress(segment, frame),
        settings=settings,
    )
    return 100.0 * float(is_hole.mean())


def _unshaded(views: Views, frame: int) -> Keyframe:
    geometry = views[frame].geometry
    size = geometry.shape_index.shape
    return Keyframe(frame, geometry, Shading(np.zeros((*size, 3), np.float32), np.zeros(size, np.float32)))


def _path_seconds(job: Job, renderer: Renderer) -> float:
    """Wall time of one path, from a few thousand spread over the middle frame."""
    frame = len(job.path) // 2
    pixels = np.linspace(0, job.path.width * job.path.height - 1, PROBE_PIXELS, dtype=np.uint32)
    seconds = 0.0
    for _ in range(2):  # the first compiles
        begin = time.perf_counter()
        renderer.trace(
            job.path.cameras[frame],
            pixels,
            RandomKey(job.settings.trace.seed, job.path.numbers[frame], Purpose.FILL),
            spp=PROBE_SPP,
            pixel_filter=PixelFilter.CENTRE,
        )
        seconds = time.perf_counter() - begin
    return seconds / (PROBE_PIXELS * PROBE_SPP)


def _shares(job: Job, survey: Survey, segments: list[Segment], holes: dict[int, float]) -> dict[str, float]:
    """Pixels that the paper's method will trace, percent, by reason."""
    count, keyframes = len(job.path), {s.first for s in segments} | {s.last for s in segments}
    shares = dict.fromkeys(("slow", "specular", "holes", "keyframes"), 0.0)
    shares["keyframes"] = 100.0 * len(keyframes) / count
    for segment in segments:
        known = [holes[f] for f in segment.inbetweens if f in holes]
        hole = sum(known) / len(known) if known else 0.0
        for frame in job.path.moving(segment):
            slow = survey.slow_percent[frame]
            rest = 1.0 - slow / 100.0  # taken as spread evenly over the image
            shares["slow"] += slow / count
            shares["specular"] += survey.specular_percent[frame] * rest / count
            shares["holes"] += hole * rest / count
    return shares


def _forecast(job: Job, shares: dict[str, float], renderer: Renderer) -> dict[str, Any]:
    traced = min(sum(shares.values()), 100.0)
    pixels = len(job.path) * job.path.width * job.path.height
    paths = round(traced / 100.0 * pixels * job.settings.trace.spp)
    return {
        "traced_percent": traced,
        "traced_percent_least": min(traced, sum(shares.values()) - shares.get("specular", 0.0)),
        "shares_percent": shares,
        "paths": paths,
        "seconds": paths * _path_seconds(job, renderer),
    }
