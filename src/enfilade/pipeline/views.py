"""What the cameras of a path see: the first thing that every later stage asks for."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass

import numpy as np

from enfilade.geometry import find_geometry, image_flow
from enfilade.pipeline.cost import Costs
from enfilade.records import F32, CameraPath, Flow, Geometry
from enfilade.renderer import Renderer
from enfilade.viewing import Viewing

KEPT = 4  # views kept in memory; finding one again costs a ray a pixel


@dataclass(frozen=True, eq=False)
class View:
    """What one frame sees, and how it moves.

    Attributes
    ----------
    geometry : Geometry
    flow : Flow
    speed_deg_s : (H, W) float32
        Velocity of each pixel's pattern (§3.3); 0 also where a rest of the camera begins and ends.
    velocity_deg_s : (H, W, 2) float32
        The same with its direction.
    """

    geometry: Geometry
    flow: Flow
    speed_deg_s: F32
    velocity_deg_s: F32


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
            view = self._find(frame)
        self._kept[frame] = view
        if len(self._kept) > KEPT:
            self._kept.popitem(last=False)
        return view

    def _find(self, frame: int) -> View:
        geometry = find_geometry(self._renderer, self._path.cameras[frame])
        neighbours = self._path.neighbours(frame)
        flow = image_flow(geometry, *neighbours)
        speed = flow.speed
        if any(camera and camera.is_same_view(geometry.camera) for camera in neighbours):
            speed = np.zeros_like(speed)  # it is looked at as long as the camera rests
        return View(
            geometry=geometry,
            flow=flow,
            speed_deg_s=self.viewing.velocity_deg_s(speed),
            velocity_deg_s=np.ascontiguousarray(self.viewing.velocity_deg_s(flow.motion)),
        )
