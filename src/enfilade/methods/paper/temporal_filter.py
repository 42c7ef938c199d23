"""The temporal part of the filter: a Gaussian along the image flow (§5.1, §5.2, §5.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr

from enfilade.arrays import Array2f, Array3f, Bool, Float, UInt, image, lanes, opaque, pixel_grid
from enfilade.kernels.gather import sample
from enfilade.methods.paper.convolve import SIGMAS
from enfilade.methods.paper.support import COVERED_PX, TemporalLimits
from enfilade.records import F32, Flow, Geometry
from enfilade.settings import AntialiasSettings

SAME_SURFACE = 0.05  # relative change of depth along the flow, frame to frame, on one surface


@dataclass(frozen=True, eq=False)
class Slice:
    """One frame as the filter needs it.

    Attributes
    ----------
    color : (H, W, 3) float32
        Already filtered spatially.
    geometry : Geometry
    flow : Flow
    """

    color: F32
    geometry: Geometry
    flow: Flow


def filter_along_flow(
    frame: Slice,
    earlier: Sequence[Slice],
    later: Sequence[Slice],
    limits: TemporalLimits,
    settings: AntialiasSettings,
) -> F32:
    """Average a frame with its neighbours along the trajectory of each pixel.

    The trajectory follows the flow of every frame that it passes, interpolated bilinearly where it
    passes between pixels, and so are the colours; it ends at the image's border.

    Parameters
    ----------
    frame
        The frame to filter.
    earlier, later
        Neighbours of the same shot, the nearest first; as many as there are, at most the reach.
    limits
        How far each pixel looks.
    settings
        With ``separate_items`` a trajectory ends where it meets another surface (§5.3).

    Returns
    -------
    (H, W, 3) float32
    """
    height, width = limits.reach.shape
    reach, least = lanes(limits.reach), lanes(limits.least)
    weights = _Weights(reach, least, settings.separate_items)
    color = lanes(frame.color)
    total, weight = Array3f(color), Float(1)
    for neighbours, is_later in ((earlier, False), (later, True)):
        walk = _Walk.start(frame, weights)
        present = frame
        for distance, following in enumerate(neighbours, start=1):
            flow = present.flow.forward if is_later else present.flow.backward
            walk.step(flow, following, distance)
            w = walk.weight(distance)
            total += w * sample(lanes(following.color), walk.x, walk.y, width=width, height=height)
            weight += w
            walk.evaluate(total, weight)
            present = following
    return image(total / weight, height, width)


@dataclass(frozen=True)
class _Weights:
    reach: Any  # Float
    least: Any  # Float
    separate_items: bool


@dataclass
class _Walk:
    """Where the trajectories stand, and which go on; lanes of the frame that is filtered."""

    weights: _Weights
    x: Any  # Float
    y: Any
    travelled: Any  # Float, pixels
    shape_index: Any  # UInt
    depth: Any  # Float
    is_open: Any  # Bool
    width: int
    height: int

    @staticmethod
    def start(frame: Slice, weights: _Weights) -> _Walk:
        height, width = frame.geometry.shape_index.shape
        _, column, row = pixel_grid(height, width)
        return _Walk(
            weights=weights,
            x=Float(column) + 0.5,
            y=Float(row) + 0.5,
            travelled=Float(0),
            shape_index=lanes(frame.geometry.shape_index),
            depth=lanes(frame.geometry.depth),
            is_open=dr.full(Bool, True, width * height),
            width=width,
            height=height,
        )

    def step(self, flow: F32, into: Slice, distance: int) -> None:
        """Follow the flow into the next frame."""
        # A slow trajectory goes on until its samples cover the pixel; all end with their reach.
        count = opaque(float(distance))
        is_wanted = (count <= self.weights.least) | (self.travelled < COVERED_PX)
        is_wanted &= count <= self.weights.reach

        step = sample(lanes(flow), self.x, self.y, width=self.width, height=self.height)
        self.x += step.x
        self.y += step.y
        self.travelled += dr.norm(Array2f(step.x, step.y))
        is_inside = (self.x >= 0) & (self.x < self.width) & (self.y >= 0) & (self.y < self.height)
        self.is_open &= is_wanted & is_inside
        if self.weights.separate_items:
            self._separate(into)

    def weight(self, distance: int) -> Any:
        """Gaussian weight of the frame at that distance, 0 where the trajectory has ended."""
        sigma = (2.0 * self.weights.reach + 1.0) / SIGMAS
        distance_sigmas = opaque(float(distance)) / sigma
        return dr.select(self.is_open, dr.exp(-0.5 * distance_sigmas * distance_sigmas), 0.0)

    def evaluate(self, *values: Any) -> None:
        """Compute everything so far: the next frame's step is then the same kernel."""
        dr.eval(self.x, self.y, self.travelled, self.depth, self.is_open, *values)

    def _separate(self, into: Slice) -> None:
        column = UInt(dr.clip(self.x, 0, self.width - 1))
        row = UInt(dr.clip(self.y, 0, self.height - 1))
        lane = row * self.width + column
        depth = dr.gather(Float, lanes(into.geometry.depth), lane)
        is_same = dr.gather(UInt, lanes(into.geometry.shape_index), lane) == self.shape_index
        is_same &= dr.abs(depth - self.depth) <= SAME_SURFACE * self.depth
        self.is_open &= is_same
        self.depth = depth
