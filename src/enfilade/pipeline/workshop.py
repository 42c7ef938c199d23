"""What the stages of one run share: renderer, settings, run folder, and the keyframes in it."""

from __future__ import annotations

from collections import OrderedDict
from functools import cached_property
from typing import Any, cast

import numpy as np

from enfilade.images import read_shading, write_shading
from enfilade.kernels.tone import display_luminance
from enfilade.methods.decoupled import Shader, VirtualImages
from enfilade.methods.paper import spatial_support_px
from enfilade.metric import Aqm, MetricOptions
from enfilade.monitor import Monitor
from enfilade.pipeline.cost import Costs
from enfilade.pipeline.job import Job
from enfilade.pipeline.views import View, Views
from enfilade.records import F32, Keyframe, Mask, Shading
from enfilade.renderer import LobeRenderer, PixelFilter, Purpose, RandomKey, Renderer, why_inseparable
from enfilade.store import Run

KEPT = 3  # keyframes kept in memory
FFT_WORKERS = 2  # threads of the metric's Fourier transforms


class Workshop:
    """Where a run is made. It knows how to trace, and what has been made already.

    Attributes
    ----------
    job, renderer, run, monitor
    views : Views
    costs : Costs
    """

    def __init__(self, job: Job, renderer: Renderer, run: Run, monitor: Monitor) -> None:
        self.job = job
        self.renderer = renderer
        self.run = run
        self.monitor = monitor
        self.costs = Costs()
        self.views = Views(renderer, job.path, job.viewing, self.costs)
        self._keyframes: OrderedDict[int, Keyframe] = OrderedDict()

    @cached_property
    def lobe_renderer(self) -> LobeRenderer:
        """The renderer, which must estimate lobes apart.

        Raises
        ------
        SettingsError
            It can't.
        """
        self.job.check_separable(why_inseparable(self.renderer))
        return cast("LobeRenderer", self.renderer)

    @cached_property
    def shader(self) -> Shader:
        """The shader, whose kernels all shots share."""
        return Shader(self.lobe_renderer)

    @cached_property
    def virtual_images(self) -> VirtualImages:
        """What is seen in mirrors and through glass."""
        return VirtualImages(self.lobe_renderer)

    @cached_property
    def aqm(self) -> Aqm:
        """The metric, with its filters made once."""
        return Aqm(self.job.viewing, mask_slope=self.job.settings.metric.mask_slope, workers=FFT_WORKERS)

    @cached_property
    def judge(self) -> Aqm:
        """The metric as it stands today, for what the paper does not ask."""
        return Aqm(self.job.viewing, options=MetricOptions.modern(), workers=FFT_WORKERS)

    def shown(self, color: F32) -> F32:
        """What the screen emits for linear colours, (H, W) cd/m2."""
        of = self.job.settings.viewing
        luminance: F32 = display_luminance(
            color, exposure_ev=of.exposure_ev, peak_cd_m2=of.peak_cd_m2, black_cd_m2=of.black_cd_m2
        )
        return luminance

    def number(self, frame: int) -> int:
        """Number by which the user knows a frame."""
        return self.job.path.numbers[frame]

    def spatial_support_px(self, view: View) -> F32:
        """Width of the spatial filter for what a frame shows, (H, W) pixels."""
        density = self.job.viewing.pixels_per_degree
        return spatial_support_px(view.speed_deg_s, density, self.job.settings.antialias)

    def trace(self, frame: int, where: Mask, purpose: Purpose, pixel_filter: PixelFilter) -> Shading:
        """Path trace some pixels of a frame, as a list in the order of the lanes."""
        settings = self.job.settings.trace
        with self.costs.of("trace"):
            return self.renderer.trace(
                self.job.path.cameras[frame],
                np.flatnonzero(where).astype(np.uint32),
                self.random(frame, purpose),
                spp=settings.spp,
                pixel_filter=pixel_filter,
            )

    def keyframe(self, frame: int) -> Keyframe:
        """A keyframe: from memory, from the run folder, or traced now."""
        if frame in self._keyframes:
            self._keyframes.move_to_end(frame)
            return self._keyframes[frame]
        keyframe = Keyframe(frame, self.views[frame].geometry, self._keyframe_shading(frame))
        self._keyframes[frame] = keyframe
        if len(self._keyframes) > KEPT:
            self._keyframes.popitem(last=False)
        return keyframe

    def random(self, frame: int, purpose: Purpose) -> RandomKey:
        """What the random numbers of a frame depend on, beside the pixel and the number of the path."""
        return RandomKey(self.job.settings.trace.seed, self.number(frame), purpose)

    def finish(self, unit: str, files: list[Any], **facts: Any) -> None:
        """Record a unit of work as done, with its costs."""
        self.run.finish(unit, files=files, facts={**facts, "cost": self.costs.take()})

    def _keyframe_shading(self, frame: int) -> Shading:
        size = self.job.path.height, self.job.path.width
        unit, file = f"keyframe {self.number(frame)}", self.run.file("keyframes", self.number(frame))
        if self.run.done(unit):
            self.run.check(file)
            return read_shading(file)
        # Paths begin at the pixels' centres, where the geometry was found: what is warped has one surface.
        traced = self.trace(frame, np.ones(size, np.bool_), Purpose.KEYFRAME, PixelFilter.CENTRE)
        shading = Shading(traced.color.reshape(*size, 3), traced.variance.reshape(size), traced.dropped)
        write_shading(file, shading)
        self.finish(unit, [file], frame=self.number(frame), dropped=shading.dropped)
        return shading
