"""A frame of a window after the filter of §5, with any settings and along any flow."""

from __future__ import annotations

from collections.abc import Callable

from enfilade.methods.paper import Slice, filter_along_flow, reconstruct, spatial_support_px, temporal_limits
from enfilade.records import F32, Geometry
from enfilade.settings import AntialiasSettings
from studies.cases.windows import Windows

__all__ = ["antialiased", "reach_of"]


def reach_of(settings: AntialiasSettings) -> int:
    """Frames to either side at which the filter may look."""
    return max(settings.frames, settings.slow_frames) // 2


def antialiased(
    windows: Windows,
    frame: int,
    color_of: Callable[[int], F32],
    settings: AntialiasSettings,
    seen_in: Callable[[int], Geometry] | None = None,
) -> F32:
    """Filter a frame with its neighbours.

    Parameters
    ----------
    windows
    frame
    color_of
        Colours of each frame before the filter, (H, W, 3) float32.
    settings
        Supports; a uniform one where the settings make no difference between velocities.
    seen_in
        Geometry of each frame whose flow is followed, in place of the surfaces' own; where it is said not
        to be specular, the filter has its whole length.

    Returns
    -------
    (H, W, 3) float32
    """
    viewing = windows.job.viewing
    span = windows.around(frame, reach_of(settings))
    slices: dict[int, Slice] = {}
    for at in span:
        speed_deg_s = windows.view(at).speed_deg_s
        support = spatial_support_px(speed_deg_s, viewing.pixels_per_degree, settings)
        geometry = windows.geometry(at) if seen_in is None else seen_in(at)
        flow = windows.flow(at, None if seen_in is None else geometry)
        slices[at] = Slice(reconstruct(color_of(at), support), geometry, flow)
    here = slices[frame]
    speed_deg_s = viewing.velocity_deg_s(here.flow.speed)
    return filter_along_flow(
        here,
        [slices[at] for at in reversed(range(span.start, frame))],
        [slices[at] for at in range(frame + 1, span.stop)],
        temporal_limits(speed_deg_s, here.geometry, settings),
        settings,
    )
