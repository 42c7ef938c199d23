"""Effect of temporal filters on reflections in mirrors (§5.4)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.ndimage import binary_erosion

from enfilade.gbuffer import image_flow
from enfilade.records import Geometry, Mask
from enfilade.settings import AntialiasSettings
from studies.cases.case import Case
from studies.cases.virtual_images import mirror_pixels
from studies.cases.visibility import scores_in
from studies.cases.windows import Windows
from studies.progress import counted

FRAME_PX = 2  # border of a mirror that is left out, since it also shows the frame
SCANNED = 24  # frames of a path that are searched for mirrors


def measure(case: Case) -> dict[str, Any]:
    """``frames``: noise-free measurements of the frames with the largest mirrors; see :func:`compare`."""
    windows = case.noise_free_windows
    probes = counted(largest_mirrors(windows, case.extent.windows), "mirrors", case.monitor)
    return {"frames": [compare(windows, frame) for frame in probes]}


def largest_mirrors(windows: Windows, count: int) -> list[int]:
    """Frames with the largest share of mirror pixels, a tenth of the path apart, in order; may be empty."""
    length = len(windows.walk.path)
    margin = min(8, length // 4)
    step = max((length - 2 * margin) // SCANNED, 1)
    share = {
        f: float(_mirror_interior(windows.geometry(f)).mean()) for f in range(margin, length - margin, step)
    }
    chosen: list[int] = []
    for frame in sorted((f for f in share if share[f] > 0.0), key=lambda f: -share[f]):
        if all(abs(frame - other) >= length / 10 for other in chosen):
            chosen.append(frame)
    return sorted(chosen[:count])


def compare(windows: Windows, frame: int) -> dict[str, Any]:
    """Compare four temporal filters on the mirrors of a frame with the reference.

    ``none``: no temporal filter. ``full``: along the motion of the mirror's surface.
    ``short``: the same over fewer frames, the paper's heuristic. ``reflected``: ``full``, along the motion of
    the virtual image.

    Returns
    -------
    dict
        ``frame``: its number; ``mirror_percent`` of its pixels; ``surface_deg_s``, ``reflected_deg_s``: mean
        velocities; ``filters``: by filter, in motion (at the velocity of the reflection), as a still, and by
        the modern mode: score, JND, and share above 1 JND.
    """
    walk, viewer = windows.walk, windows.viewer
    settings = walk.settings[AntialiasSettings]
    mirror, reference = _mirror_interior(windows.geometry(frame)), windows.reference(frame).color
    flow = image_flow(windows.reflected_geometry(frame), *walk.path.neighbours(frame))
    velocity = walk.viewing.velocity_deg_s(flow.motion)
    full = replace(settings, specular_frames=settings.frames)
    colors = {
        "none": windows.antialiased(frame, replace(settings, specular_frames=1)),
        "full": windows.antialiased(frame, full),
        "short": windows.antialiased(frame, settings),
        "reflected": windows.antialiased(frame, full, geometry_of=windows.reflected_geometry),
    }
    filters = {}
    for name, color in colors.items():
        maps = {
            "motion": viewer.paper(color, reference, velocity),
            "still": viewer.paper(color, reference, None),
            "modern": viewer.modern(color, reference, velocity),
        }
        filters[name] = {how: scores_in(jnd, mirror) for how, jnd in maps.items()}
    return {
        "frame": walk.path.numbers[frame],
        "mirror_percent": 100.0 * float(mirror.mean()),
        "surface_deg_s": float(windows.view(frame).speed_deg_s[mirror].mean()),
        "reflected_deg_s": float(np.hypot(velocity[..., 0], velocity[..., 1])[mirror].mean()),
        "filters": filters,
    }


def _mirror_interior(geometry: Geometry) -> Mask:
    inner: Mask = binary_erosion(mirror_pixels(geometry), iterations=FRAME_PX)
    return inner
