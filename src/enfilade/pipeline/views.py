"""What the cameras of a path see: the first thing that every later stage asks for."""

from __future__ import annotations

from collections import OrderedDict
from functools import cached_property

import numpy as np

from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera
from enfilade.gbuffer import find_geometry, image_flow
from enfilade.pipeline.cost import Costs
from enfilade.records import F32, Flow, Geometry
from enfilade.renderer import Renderer
from enfilade.viewing import Viewing

KEPT = 4  # views kept in memory; finding one again costs a ray a pixel


class View:
    """What one frame sees, and how it moves.

    Parameters
    ----------
    geometry
    previous, following
        Cameras of the frames beside it in the same shot; None where there is none.
    viewing
    costs

    Attributes
    ----------
    geometry : Geometry
    """

    def __init__(
        self,
        geometry: Geometry,
        previous: Camera | None,
        following: Camera | None,
        viewing: Viewing,
        costs: Costs,
    ) -> None:
        self.geometry = geometry
        self._neighbours = previous, following
        self._viewing = viewing
        self._costs = costs

    @cached_property
    def flow(self) -> Flow:
        """Image flow, found when asked for."""
        with self._costs.of("geometry"):
            return image_flow(self.geometry, *self._neighbours)

    @cached_property
    def speed_deg_s(self) -> F32:
        """Velocity of each pixel's pattern (§3.3), (H, W); 0 where a rest of the camera begins and ends."""
        speed = self.flow.speed
        if any(camera and camera.is_same_view(self.geometry.camera) for camera in self._neighbours):
            speed = np.zeros_like(speed)  # it is looked at as long as the camera rests
        return self._viewing.velocity_deg_s(speed)

    @cached_property
    def velocity_deg_s(self) -> F32:
        """Velocity for the metric, (H, W, 2): the mean of both flows, at the ends of a rest, too."""
        return np.ascontiguousarray(self._viewing.velocity_deg_s(self.flow.motion))


class Views:
    """The views of a path, found when asked for."""

    def __init__(self, renderer: Renderer, path: CameraPath, viewing: Viewing, costs: Costs) -> None:
        self._renderer = renderer
        self._path = path
        self.viewing = viewing
        self._costs = costs
        self._kept: OrderedDict[int, View] = OrderedDict()

    def __getitem__(self, frame: int) -> View:
        """Find what a frame sees."""
        if frame in self._kept:
            self._kept.move_to_end(frame)
            return self._kept[frame]
        with self._costs.of("geometry"):
            geometry = find_geometry(self._renderer, self._path.cameras[frame])
        view = View(geometry, *self._path.neighbours(frame), self.viewing, self._costs)
        self._kept[frame] = view
        if len(self._kept) > KEPT:
            self._kept.popitem(last=False)
        return view
