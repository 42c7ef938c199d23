"""3D warping of keyframes, and compositing of two warps (§2.2, Fig. 3)."""

from enfilade.warp.composite import agrees, composite
from enfilade.warp.forward import warp_keyframe

__all__ = ["agrees", "composite", "warp_keyframe"]
