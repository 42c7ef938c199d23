"""§5.4: what filtering along the flow does to what mirrors show."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.ndimage import binary_erosion

from enfilade.records import F32, Geometry, Mask
from studies.cases.filtering import antialiased
from studies.cases.mirrored import mirror_pixels
from studies.cases.seen import Viewer, score_in, visible_percent
from studies.cases.windows import Example, Row, Windows

__all__ = ["measure", "most_mirrors"]

FRAME_PX = 2  # of a mirror's border, which shows its frame beside it: left out
SCANNED = 24  # frames of a path that are looked at for mirrors


def most_mirrors(windows: Windows, count: int) -> list[int]:
    """Frames that show most of mirrors, a tenth of the path apart, in order; none without mirrors."""
    length = len(windows.job.path)
    margin = min(8, length // 4)
    step = max((length - 2 * margin) // SCANNED, 1)
    share = {f: float(_inner(windows.geometry(f)).mean()) for f in range(margin, length - margin, step)}
    chosen: list[int] = []
    for frame in sorted((f for f in share if share[f] > 0.0), key=lambda f: -share[f]):
        if all(abs(frame - other) >= length / 10 for other in chosen):
            chosen.append(frame)
    return sorted(chosen[:count])


def measure(windows: Windows, probes: list[int]) -> tuple[dict[str, Any], Example]:
    """Compare four temporal filters on mirrors with what should be seen in them.

    ``none``: no temporal filter. ``full``: along the flow of the mirror's surface, as everywhere.
    ``short``: the same over few frames, the paper's heuristic. ``reflected``: full, along the flow of the
    virtual image.

    Returns
    -------
    rows : dict
        ``frames``: of each probe its number, ``mirror_percent`` of its pixels, and by filter, in motion
        (at the velocity of what is seen in the mirror) and as stills: score, JND, and share above 1 JND.
    example : dict
        Colours by filter and ``reference`` of the probe with most mirrors, and ``mirror`` 0 or 1.
    """
    rows, examples = windows.each("mirrors", probes, _probe)
    most = int(np.argmax([row["mirror_percent"] for row in rows]))
    return {"frames": rows, "example": rows[most]["frame"]}, examples[most]


def _probe(windows: Windows, viewer: Viewer, frame: int) -> tuple[Row, Example]:
    settings = windows.job.settings.antialias
    geometry, seen = windows.geometry(frame), windows.seen(frame)
    mirror = _inner(geometry)
    reference = windows.reference(frame).color
    velocity = windows.job.viewing.velocity_deg_s(windows.flow(frame, seen).motion)

    def filtered(frames: int, *, follows: bool = False) -> F32:
        chosen = replace(settings, specular_frames=frames)
        return antialiased(
            windows, frame, lambda f: windows.traced(f).color, chosen, windows.seen if follows else None
        )

    made = {
        "none": filtered(1),
        "full": filtered(settings.frames),
        "short": filtered(settings.specular_frames),
        "reflected": filtered(settings.frames, follows=True),
    }
    by_filter = {}
    for name, color in made.items():
        maps = {"motion": viewer.paper(color, reference, velocity)}
        maps["still"] = viewer.paper(color, reference, None)
        maps["modern"] = viewer.modern(color, reference, velocity)
        by_filter[name] = {
            how: {"score": score_in(jnd, mirror), "visible_percent": visible_percent(jnd, mirror)}
            for how, jnd in maps.items()
        }
    speed = np.hypot(velocity[..., 0], velocity[..., 1])
    own = windows.view(frame).speed_deg_s
    row = {
        "frame": windows.job.path.numbers[frame],
        "mirror_percent": 100.0 * float(mirror.mean()),
        "surface_deg_s": float(own[mirror].mean()),
        "reflected_deg_s": float(speed[mirror].mean()),
        "filters": by_filter,
    }
    return row, {**made, "reference": reference, "mirror": mirror.astype(np.float32)}


def _inner(geometry: Geometry) -> Mask:
    inner: Mask = binary_erosion(mirror_pixels(geometry), iterations=FRAME_PX)
    return inner
