"""§5.3 and Fig. 10: whether the ghosts are seen that the filter leaves beside what occludes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from enfilade.records import F32, Mask
from enfilade.studies.cases.filtering import antialiased
from enfilade.studies.cases.seen import Viewer, score_in, visible_percent
from enfilade.studies.cases.windows import Windows

__all__ = ["Example", "ghost_pixels", "measure"]

GHOST_CD_M2 = (
    1.0  # difference on the screen, of 100, that separation makes: below it there is no ghost to see
)
Example = dict[str, F32]


def measure(windows: Windows, probes: list[int]) -> tuple[dict[str, Any], Example]:
    """Compare the filter without and with separation, in motion and as stills.

    Returns
    -------
    rows : dict
        ``frames``: of each probe its number, mean velocity, share of ghost pixels, and there, for
        ``together`` (without separation) and ``apart``, in motion and as stills: the score, JND, and the
        share above 1 JND, percent, against the frame as it should be (``reference``), and against the
        unfiltered one as the paper does (``raw``); ``effect``: the one against the other.
    example : dict
        Images of the probe with most ghosts, as Fig. 10 has them: ``raw``, ``together``, ``apart``
        colours, ``ghost``, ``motion`` and ``still`` JND of together against apart, ``speed_deg_s``.
    """
    windows.monitor.stage("flow separation", len(probes))
    viewer = Viewer(windows.job.viewing, windows.job.settings.viewing)
    rows, examples = [], []
    for frame in probes:
        row, example = _probe(windows, viewer, frame)
        rows.append(row)
        examples.append(example)
        windows.monitor.advance()
    most = int(np.argmax([row["ghost_percent"] for row in rows]))
    return {"frames": rows, "example": rows[most]["frame"]}, examples[most]


def ghost_pixels(viewer: Viewer, together: F32, apart: F32) -> Mask:
    """Pixels that separation changes on the screen, (H, W): samples of another surface were mixed in."""
    ghost: Mask = np.abs(viewer.shown(together) - viewer.shown(apart)) > GHOST_CD_M2
    return ghost


def _probe(windows: Windows, viewer: Viewer, frame: int) -> tuple[dict[str, Any], Example]:
    settings, view = windows.job.settings.antialias, windows.view(frame)
    raw, reference = windows.traced(frame).color, windows.reference(frame).color

    def filtered(separate: bool) -> F32:
        chosen = replace(settings, separate_items=separate)
        return antialiased(windows, frame, lambda f: windows.traced(f).color, chosen)

    made = {"together": filtered(separate=False), "apart": filtered(separate=True)}
    ghost = ghost_pixels(viewer, made["together"], made["apart"])

    def judged(test: F32, wanted: F32) -> tuple[dict[str, Any], dict[str, F32]]:
        maps = {"motion": viewer.paper(test, wanted, view.velocity_deg_s)}
        maps["still"] = viewer.paper(test, wanted, None)
        numbers = {
            name: {"score": score_in(jnd, ghost), "visible_percent": visible_percent(jnd, ghost)}
            for name, jnd in maps.items()
        }
        return numbers, maps

    effect, maps = judged(made["together"], made["apart"])
    row = {
        "frame": windows.job.path.numbers[frame],
        "mean_deg_s": float(view.speed_deg_s.mean()),
        "ghost_deg_s": float(np.median(view.speed_deg_s[ghost])) if ghost.any() else None,
        "ghost_percent": 100.0 * float(ghost.mean()),
        "effect": effect,
        "reference": {name: judged(color, reference)[0] for name, color in made.items()},
        "raw": {name: judged(color, raw)[0] for name, color in made.items()},
    }
    images = {**made, "raw": raw, "reference": reference, **maps, "ghost": ghost.astype(np.float32)}
    return row, {**images, "speed_deg_s": view.speed_deg_s}
