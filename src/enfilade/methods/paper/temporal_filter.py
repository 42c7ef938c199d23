"""The temporal part of the filter: a Gaussian along the image flow (§5.1, §5.2, §5.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr

from enfilade.arrays import Array2f, Array3f, Bool, Float, UInt, image, lanes, opaque
from enfilade.kernels.bilinear import sample
from enfilade.kernels.rays import pixel_centres
from enfilade.methods.paper.spatial_filter import SIGMAS
from enfilade.methods.paper.support import COVERED_PX, TemporalLimits
from enfilade.records import F32, Flow, Geometry
from enfilade.settings import AntialiasSettings

SAME_SURFACE = 0.05  # largest relative change of depth from frame to frame on one surface
BESIDE_PX = 0.5  # by which two surfaces move apart at most, while their mixture is that of the frame


@dataclass(frozen=True, eq=False)
class Slice:
    """One frame of the filter's support.

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

    From frame to frame a trajectory follows the flow, which is interpolated bilinearly, as are the colours.
    It ends at the image's border.

    Parameters
    ----------
    frame
        The frame to filter.
    earlier, later
        Neighbours of the same shot, the nearest first; at most the reach, fewer at the ends of the shot.
    limits
        Temporal support.
    settings
        With ``separate_shapes`` a trajectory ends where it meets another surface (§5.3).

    Returns
    -------
    (H, W, 3) float32
    """
    height, width = limits.reach.shape
    weights = _Weights(lanes(limits.reach), lanes(limits.least), settings.separate_shapes)
    color = lanes(frame.color)
    total, weight = Array3f(color), Float(1)
    for neighbours, is_later in ((earlier, False), (later, True)):
        trajectories = _Trajectories.start(frame, weights)
        present = frame
        for distance, following in enumerate(neighbours, start=1):
            # Advance to the next frame.
            flow = present.flow.forward if is_later else present.flow.backward
            back = following.flow.backward if is_later else following.flow.forward
            trajectories.step(flow, back, following.geometry, distance)

            # Accumulate its colours.
            w = trajectories.weight(distance)
            at = trajectories.x, trajectories.y
            total += w * sample(lanes(following.color), *at, width=width, height=height)
            weight += w
            trajectories.evaluate(total, weight)
            present = following
    return image(total / weight, height, width)


@dataclass(frozen=True)
class _Weights:
    reach: Any  # Float
    least: Any  # Float
    separate_shapes: bool


@dataclass
class _Trajectories:
    """Positions of all trajectories at a frame; lanes of the frame that is filtered."""

    weights: _Weights
    x: Any  # Float
    y: Any
    travelled: Any  # Float, pixels
    shape_index: Any  # UInt
    depth: Any  # Float
    is_open: Any  # Bool: not ended yet
    width: int
    height: int

    @staticmethod
    def start(frame: Slice, weights: _Weights) -> _Trajectories:
        height, width = frame.geometry.shape_index.shape
        at = pixel_centres(frame.geometry.camera)
        return _Trajectories(
            weights=weights,
            x=at.x,
            y=at.y,
            travelled=Float(0),
            shape_index=lanes(frame.geometry.shape_index),
            depth=lanes(frame.geometry.depth),
            is_open=dr.full(Bool, True, width * height),
            width=width,
            height=height,
        )

    def step(self, flow: F32, back: F32, into: Geometry, distance: int) -> None:
        """Follow the flow into the next frame, of which `back` is the flow to this one."""
        # End at the reach, and slow trajectories where their samples cover the pixel.
        count = opaque(float(distance))
        is_wanted = (count <= self.weights.least) | (self.travelled < COVERED_PX)
        is_wanted &= count <= self.weights.reach

        # Move by the flow.
        step = sample(lanes(flow), self.x, self.y, width=self.width, height=self.height)
        self.x += step.x
        self.y += step.y
        self.travelled += dr.norm(Array2f(step.x, step.y))

        # End outside the image, and on another surface.
        is_inside = (self.x >= 0) & (self.x < self.width) & (self.y >= 0) & (self.y < self.height)
        self.is_open &= is_wanted & is_inside
        if self.weights.separate_shapes:
            self._separate(into, step, lanes(back), count)

    def weight(self, distance: int) -> Any:
        """Gaussian weight of the frame at that distance, 0 where the trajectory has ended."""
        sigma = (2.0 * self.weights.reach + 1.0) / SIGMAS
        distance_sigmas = opaque(float(distance)) / sigma
        return dr.select(self.is_open, dr.exp(-0.5 * distance_sigmas * distance_sigmas), 0.0)

    def evaluate(self, *values: Any) -> None:
        """Evaluate everything so far, so that the step to the next frame is the same kernel."""
        dr.eval(self.x, self.y, self.travelled, self.depth, self.is_open, *values)

    def _separate(self, into: Geometry, step: Any, back: Any, count: Any) -> None:
        """End trajectories that meet another surface, if that moves otherwise.

        Surfaces that move alike stay beside each other: their mixture at an outline is antialiasing.
        """
        column = UInt(dr.clip(self.x, 0, self.width - 1))
        row = UInt(dr.clip(self.y, 0, self.height - 1))
        lane = row * self.width + column
        depth = dr.gather(Float, lanes(into.depth), lane)
        is_same = dr.gather(UInt, lanes(into.shape_index), lane) == self.shape_index
        is_same &= dr.abs(depth - self.depth) <= SAME_SURFACE * self.depth
        apart = count * dr.norm(step + dr.gather(Array2f, back, lane))
        self.is_open &= is_same | (apart < BESIDE_PX)
        self.depth = dr.select(is_same, depth, self.depth)
