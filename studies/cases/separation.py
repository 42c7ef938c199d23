"""§5.3 and Fig. 10: visibility of the ghosts that the filter leaves along occluding edges.

Flow separation ends trajectories where they meet another surface. Away from outlines this removes ghosts; at
outlines it removes the samples that would have antialiased them. Both are measured apart.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.ndimage import binary_dilation

from enfilade.gbuffer import View
from enfilade.records import F32, U32, Mask
from enfilade.settings import AntialiasSettings
from studies.cases.case import Case
from studies.cases.pictures import write_example
from studies.cases.seen import Viewer, scores_in
from studies.cases.windows import Windows
from studies.progress import counted

Example = dict[str, F32]  # images of a frame

GHOST_CD_M2 = 1.0  # difference on the screen, of 100, made by separation: smaller ones are invisible
FEWEST = 200  # pixels: fewer are not reported
OUTLINE_PX = 2  # from an outline: differences nearer to it are a matter of antialiasing


def measure(case: Case) -> dict[str, Any]:
    """Measurements of all probes; the images of an example are written beside. See :func:`compare`."""
    rows, example = compare(case.plain_windows, case.plain_windows.probes)
    write_example(case.folder / "separation.npz", example)
    return rows


def compare(windows: Windows, probes: list[int]) -> tuple[dict[str, Any], Example]:
    """Compare the filter without and with separation, in motion and as stills.

    Returns
    -------
    rows : dict
        ``frames``: of each probe its number, and for ``ghosts`` (without separation farther from the
        reference) and ``outlines`` the ``count`` of pixels and their share, ``pixels``, percent, their median
        velocity ``deg_s`` (None where there are none), and, in motion and as stills, the score, JND, and the
        share above 1 JND, percent: of ``together`` (without separation) and ``apart`` against the reference
        (``reference``), and of the former against the unfiltered frame, as in the paper (``raw``);
        ``effect``: the one against the other.
    example : dict
        Images of the probe with most ghosts, as in Fig. 10: ``raw``, ``together``, ``apart`` and
        ``reference`` colours, ``ghost``, ``motion`` and ``still`` JND of together against apart,
        ``speed_deg_s``.
    """
    frames = counted(probes, "flow separation", windows.monitor)
    rows, examples = zip(*(_compare(windows, frame) for frame in frames), strict=True)
    most = int(np.argmax([row["ghosts"]["pixels"] for row in rows]))
    return {"frames": list(rows), "example": rows[most]["frame"]}, examples[most]


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


def _compare(windows: Windows, frame: int) -> tuple[dict[str, Any], Example]:
    view, viewer = windows.view(frame), windows.viewer
    settings = windows.walk.settings[AntialiasSettings]
    raw, reference = windows.traced(frame).color, windows.reference(frame).color
    together, apart = (
        windows.antialiased(frame, replace(settings, separate_shapes=separate)) for separate in (False, True)
    )
    changed, near = changed_pixels(viewer, together, apart), outlines(view.geometry.shape_index)
    errors = [np.abs(viewer.shown(image) - viewer.shown(reference)) for image in (together, apart)]
    places = {"ghosts": changed & ~near & (errors[0] > errors[1]), "outlines": changed & near}
    maps = {
        kind: {how: viewer.paper(test, wanted, velocity) for how, velocity in _velocities(view).items()}
        for kind, (test, wanted) in {
            "effect": (together, apart),
            "reference together": (together, reference),
            "reference apart": (apart, reference),
            "raw together": (together, raw),
        }.items()
    }
    row: dict[str, Any] = {"frame": windows.walk.path.numbers[frame]}
    for place, where in places.items():
        row[place] = {
            "count": int(where.sum()),
            "pixels": 100.0 * float(where.mean()),
            "deg_s": float(np.median(view.speed_deg_s[where])) if where.any() else None,
            **{kind: {how: scores_in(jnd, where) for how, jnd in by.items()} for kind, by in maps.items()},
        }
    images = {"together": together, "apart": apart, "raw": raw, "reference": reference, **maps["effect"]}
    return row, {**images, "ghost": places["ghosts"].astype(np.float32), "speed_deg_s": view.speed_deg_s}


def _velocities(view: View) -> dict[str, F32 | None]:
    return {"motion": view.velocity_deg_s, "still": None}
