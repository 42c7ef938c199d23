"""Myszkowski, Rokita and Tawara 2000: 3D warping (§2.2), masks (§4), spatiotemporal filter (§5)."""

from enfilade.methods.paper.composite import agrees, composite
from enfilade.methods.paper.forward import warp_keyframe
from enfilade.methods.paper.spatial import reconstruct
from enfilade.methods.paper.support import spatial_support_px, temporal_limits
from enfilade.methods.paper.temporal import Slice, filter_along_flow

__all__ = [
    "Slice",
    "agrees",
    "composite",
    "filter_along_flow",
    "reconstruct",
    "spatial_support_px",
    "temporal_limits",
    "warp_keyframe",
]
