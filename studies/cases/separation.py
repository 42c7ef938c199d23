"""§5.3 and Fig. 10: whether the ghosts are seen that the filter leaves beside what occludes.

Where trajectories meet another surface, separation ends them. Away from outlines that takes away ghosts; at
outlines it takes away the samples that would have antialiased them. Both are told apart here.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.ndimage import binary_dilation

from enfilade.pipeline.views import View
from enfilade.records import F32, U32, Mask
from studies.cases.filtering import antialiased
from studies.cases.seen import Viewer, score_in, visible_percent
from studies.cases.windows import Example, Row, Windows

__all__ = ["changed_pixels", "measure", "outlines"]

GHOST_CD_M2 = 1.0  # difference on the screen, of 100, that separation makes: below it nothing is to be seen
FEWEST = 200  # pixels of which something is said
OUTLINE_PX = 2  # from an outline: what differs nearer to it is a matter of antialiasing


def measure(windows: Windows, probes: list[int]) -> tuple[dict[str, Any], Example]:
    """Compare the filter without and with separation, in motion and as stills.

    Returns
    -------
    rows : dict
        ``frames``: of each probe its number, and for ``ghosts`` (without separation farther from the frame as
        it should be) and ``outlines`` the ``count`` of pixels and their share, ``pixels``, percent, their
        median velocity (None where there are none), and, in motion and as stills, the score, JND, and the
        share above 1 JND, percent: of ``together`` (without separation) and ``apart`` against the frame as
        it should be (``reference``), and of the former against the unfiltered one as the paper does
        (``raw``); ``effect``: the one against the other.
    example : dict
        Images of the probe with most ghost pixels, as Fig. 10 has them: ``raw``, ``together``, ``apart``
        colours, ``ghost``, ``motion`` and ``still`` JND of together against apart, ``speed_deg_s``.
    """
    rows, examples = windows.each("flow separation", probes, _probe)
    most = int(np.argmax([row["ghosts"]["pixels"] for row in rows]))
    return {"frames": rows, "example": rows[most]["frame"]}, examples[most]


def outlines(shape_index: U32) -> Mask:
    """Pixels at most :data:`OUTLINE_PX` from another shape, (H, W)."""
    edge = np.zeros(shape_index.shape, bool)
    across, down = shape_index[:, 1:] != shape_index[:, :-1], shape_index[1:] != shape_index[:-1]
    edge[:, 1:] |= across
    edge[:, :-1] |= across
    edge[1:] |= down
    edge[:-1] |= down
    near: Mask = binary_dilation(edge, np.ones((3, 3), bool), iterations=OUTLINE_PX - 1)
    return near


def changed_pixels(viewer: Viewer, together: F32, apart: F32) -> Mask:
    """Pixels that separation changes on the screen, (H, W): samples of another surface were mixed in."""
    changed: Mask = np.abs(viewer.shown(together) - viewer.shown(apart)) > GHOST_CD_M2
    return changed


def _probe(windows: Windows, viewer: Viewer, frame: int) -> tuple[Row, Example]:
    settings, view = windows.job.settings.antialias, windows.view(frame)
    raw, reference = windows.traced(frame).color, windows.reference(frame).color

    def filtered(*, separate: bool) -> F32:
        chosen = replace(settings, separate_items=separate)
        return antialiased(windows, frame, lambda f: windows.traced(f).color, chosen)

    together, apart = filtered(separate=False), filtered(separate=True)
    changed, near = changed_pixels(viewer, together, apart), outlines(view.geometry.shape_index)
    shown = [np.abs(viewer.shown(image) - viewer.shown(reference)) for image in (together, apart)]
    places = {"ghosts": changed & ~near & (shown[0] > shown[1]), "outlines": changed & near}
    maps = {
        kind: {how: viewer.paper(test, wanted, velocity) for how, velocity in _hows(view).items()}
        for kind, (test, wanted) in {
            "effect": (together, apart),
            "reference together": (together, reference),
            "reference apart": (apart, reference),
            "raw together": (together, raw),
        }.items()
    }
    row: Row = {"frame": windows.job.path.numbers[frame]}
    for place, where in places.items():
        row[place] = {
            "count": int(where.sum()),
            "pixels": 100.0 * float(where.mean()),
            "deg_s": float(np.median(view.speed_deg_s[where])) if where.any() else None,
            **{kind: {how: _said(jnd, where) for how, jnd in by.items()} for kind, by in maps.items()},
        }
    images = {"together": together, "apart": apart, "raw": raw, "reference": reference, **maps["effect"]}
    return row, {**images, "ghost": places["ghosts"].astype(np.float32), "speed_deg_s": view.speed_deg_s}


def _hows(view: View) -> dict[str, F32 | None]:
    return {"motion": view.velocity_deg_s, "still": None}


def _said(jnd: F32, where: Mask) -> dict[str, float | None]:
    return {"score": score_in(jnd, where), "visible_percent": visible_percent(jnd, where)}
