"""Motion-compensated spatiotemporal antialiasing (§5)."""

from enfilade.antialias.spatial import reconstruct
from enfilade.antialias.support import spatial_support_px, temporal_limits
from enfilade.antialias.temporal import Slice, filter_along_flow

__all__ = ["Slice", "filter_along_flow", "reconstruct", "spatial_support_px", "temporal_limits"]
