"""§5.4: effect of temporal filters on the reflections in mirrors."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.ndimage import binary_erosion

from enfilade.records import Geometry, Mask
from enfilade.settings import AntialiasSettings
from studies.cases.case import Case
from studies.cases.filtering import antialiased
from studies.cases.mirrored import mirror_pixels
from studies.cases.pictures import write_example
from studies.cases.seen import scores_in
from studies.cases.windows import Example, Row, Windows

__all__ = ["compare", "measure", "most_mirrors"]

FRAME_PX = 2  # of a mirror's border, which shows its frame, too: left out
SCANNED = 24  # frames of a path that are searched for mirrors


def measure(case: Case) -> dict[str, Any]:
    """Measurements of the frames with most mirrors; the images of an example are written beside."""
    windows = case.plain_windows
    probes = most_mirrors(windows, case.terms.windows)
    if not probes:
        return {"frames": []}
    rows, example = compare(windows, probes)
    write_example(case.folder / "reflections.npz", example)
    return rows


def most_mirrors(windows: Windows, count: int) -> list[int]:
    """Frames that show most of mirrors, a tenth of the path apart, in order; none without mirrors."""
    length = len(windows.walk.path)
    margin = min(8, length // 4)
    step = max((length - 2 * margin) // SCANNED, 1)
    share = {f: float(_inner(windows.geometry(f)).mean()) for f in range(margin, length - margin, step)}
    chosen: list[int] = []
    for frame in sorted((f for f in share if share[f] > 0.0), key=lambda f: -share[f]):
        if all(abs(frame - other) >= length / 10 for other in chosen):
            chosen.append(frame)
    return sorted(chosen[:count])


def compare(windows: Windows, probes: list[int]) -> tuple[dict[str, Any], Example]:
    """Compare four temporal filters on mirrors with the reference.

    ``none``: no temporal filter. ``full``: along the motion of the mirror's surface, as everywhere.
    ``short``: the same over few frames, the paper's heuristic. ``reflected``: full, along the motion of the
    virtual image.

    Returns
    -------
    rows : dict
        ``frames``: of each probe its number, ``mirror_percent`` of its pixels, and by filter, in motion (at
        the velocity of the reflection) and as stills: score, JND, and share above 1 JND.
    example : dict
        Colours by filter and ``reference`` of the probe with most mirrors, and ``mirror`` 0 or 1.
    """
    rows, examples = windows.each("mirrors", probes, _compare)
    most = int(np.argmax([row["mirror_percent"] for row in rows]))
    return {"frames": rows, "example": rows[most]["frame"]}, examples[most]


def _compare(windows: Windows, frame: int) -> tuple[Row, Example]:
    walk, viewer = windows.walk, windows.viewer
    settings = walk.settings[AntialiasSettings]
    mirror, reference = _inner(windows.geometry(frame)), windows.reference(frame).color
    velocity = walk.viewing.velocity_deg_s(windows.flow(frame, windows.reflected(frame)).motion)
    full = replace(settings, specular_frames=settings.frames)
    made = {
        "none": antialiased(windows, frame, replace(settings, specular_frames=1)),
        "full": antialiased(windows, frame, full),
        "short": antialiased(windows, frame, settings),
        "reflected": antialiased(windows, frame, full, geometry_of=windows.reflected),
    }
    filters = {}
    for name, color in made.items():
        maps = {
            "motion": viewer.paper(color, reference, velocity),
            "still": viewer.paper(color, reference, None),
            "modern": viewer.modern(color, reference, velocity),
        }
        filters[name] = {how: scores_in(jnd, mirror) for how, jnd in maps.items()}
    row = {
        "frame": walk.path.numbers[frame],
        "mirror_percent": 100.0 * float(mirror.mean()),
        "surface_deg_s": float(windows.view(frame).speed_deg_s[mirror].mean()),
        "reflected_deg_s": float(np.hypot(velocity[..., 0], velocity[..., 1])[mirror].mean()),
        "filters": filters,
    }
    return row, {**made, "reference": reference, "mirror": mirror.astype(np.float32)}


def _inner(geometry: Geometry) -> Mask:
    inner: Mask = binary_erosion(mirror_pixels(geometry), iterations=FRAME_PX)
    return inner
