"""The G-buffer of a frame with its motion vectors and velocities."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from enfilade.camera.pinhole import Camera
from enfilade.gbuffer.motion import image_flow
from enfilade.records import F32, Flow, Geometry
from enfilade.viewing import Viewing


class View:
    """The G-buffer of one frame, with its motion vectors and velocities.

    Parameters
    ----------
    geometry
        The G-buffer.
    previous, following
        Cameras of the neighbouring frames in the same shot; None at its ends.
    viewing
        Viewing conditions.
    is_at_rest
        Whether the frame is seen for as long as the camera stands still.
    """

    def __init__(
        self,
        geometry: Geometry,
        previous: Camera | None,
        following: Camera | None,
        viewing: Viewing,
        *,
        is_at_rest: bool,
    ) -> None:
        self.geometry = geometry
        self._is_at_rest = is_at_rest
        self._neighbours = previous, following
        self._viewing = viewing

    @cached_property
    def flow(self) -> Flow:
        """Motion vectors to the previous and the next frame."""
        return image_flow(self.geometry, *self._neighbours)

    @cached_property
    def speed_deg_s(self) -> F32:
        """Speed of each pixel's pattern (§3.3), (H, W); 0 while the camera rests."""
        speed = np.zeros_like(self.flow.speed) if self._is_at_rest else self.flow.speed
        return self._viewing.velocity_deg_s(speed)

    @cached_property
    def velocity_deg_s(self) -> F32:
        """Velocity for the metric, (H, W, 2): the mean of both motion vectors."""
        return np.ascontiguousarray(self._viewing.velocity_deg_s(self.flow.motion))
