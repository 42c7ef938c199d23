"""A frame of a window after the filter of §5, with any settings and along any motion vectors."""

from __future__ import annotations

from collections.abc import Callable

from enfilade.methods.paper.spatial_filter import reconstruct
from enfilade.methods.paper.support import spatial_support_px, temporal_limits
from enfilade.methods.paper.temporal_filter import Slice, filter_along_flow
from enfilade.records import F32, Geometry
from enfilade.settings import AntialiasSettings
from studies.cases.windows import Windows

__all__ = ["antialiased", "reach_of"]


def reach_of(settings: AntialiasSettings) -> int:
    """Frames to either side that the filter may use."""
    return max(settings.frames, settings.slow_frames) // 2


def antialiased(
    windows: Windows,
    frame: int,
    settings: AntialiasSettings,
    color_of: Callable[[int], F32] | None = None,
    geometry_of: Callable[[int], Geometry] | None = None,
) -> F32:
    """Filter a frame with its neighbours.

    Parameters
    ----------
    windows
    frame
    settings
        Supports; uniform ones where the settings make no difference between velocities.
    color_of
        Colours of each frame before the filter, (H, W, 3) float32; by default those of the traced frames.
    geometry_of
        Geometry of each frame whose motion is followed, in place of the visible surfaces'. Where it is not
        specular, the filter has its full length.

    Returns
    -------
    (H, W, 3) float32
    """
    viewing = windows.walk.viewing
    span = windows.around(frame, reach_of(settings))
    slices: dict[int, Slice] = {}
    for at in span:
        color = windows.traced(at).color if color_of is None else color_of(at)
        support = spatial_support_px(windows.view(at).speed_deg_s, viewing.pixels_per_degree, settings)
        geometry = windows.geometry(at) if geometry_of is None else geometry_of(at)
        flow = windows.flow(at, None if geometry_of is None else geometry)
        slices[at] = Slice(reconstruct(color, support), geometry, flow)
    here = slices[frame]
    return filter_along_flow(
        here,
        [slices[at] for at in reversed(range(span.start, frame))],
        [slices[at] for at in range(frame + 1, span.stop)],
        temporal_limits(viewing.velocity_deg_s(here.flow.speed), here.geometry, settings),
        settings,
    )
