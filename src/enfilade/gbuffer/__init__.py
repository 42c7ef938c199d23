"""What each pixel of each frame sees, and how it moves (§3.3)."""

from enfilade.gbuffer.geometry import find_geometry, positions
from enfilade.gbuffer.motion import image_flow

__all__ = ["find_geometry", "image_flow", "positions"]
