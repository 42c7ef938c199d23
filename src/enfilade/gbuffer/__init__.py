"""The G-buffer of each frame, its motion vectors and velocities (§3.3)."""

from enfilade.gbuffer.geometry import find_geometry, positions
from enfilade.gbuffer.motion import image_flow
from enfilade.gbuffer.view import View

__all__ = ["View", "find_geometry", "image_flow", "positions"]
