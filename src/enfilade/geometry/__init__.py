"""What each pixel of each frame sees, and how it moves (§3.3)."""

from enfilade.geometry.flow import image_flow
from enfilade.geometry.gbuffer import find_geometry, positions

__all__ = ["find_geometry", "image_flow", "positions"]
