"""Visibility of ghosts at occluding edges, with and without flow separation (§5.3, Fig. 10).

Flow separation ends trajectories at other surfaces. Away from outlines this removes ghosts; at outlines it
also removes samples that contribute to antialiasing. The two regions are measured separately.
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
from studies.cases.visibility import Viewer, scores_in
from studies.cases.windows import Windows
from studies.progress import counted

Example = dict[str, F32]  # images of a frame

GHOST_CD_M2 = 1.0  # effect of separation on the luminance (white: 100); smaller ones are invisible
MIN_PIXELS = 200  # of a region: smaller ones are not reported
OUTLINE_PX = 2  # half width of outlines, where differences are due to antialiasing


def measure(case: Case) -> dict[str, Any]:
    """Measure all probes, and write the images of an example; see :func:`compare`."""
    rows, example = compare(case.noise_free_windows, case.noise_free_windows.probes)
    write_example(case.folder / "separation.npz", example)
    return rows


def compare(windows: Windows, probes: list[int]) -> tuple[dict[str, Any], Example]:
    """Compare the filter without and with separation, in motion and as stills.

    Returns
    -------
    rows : dict
        ``frames``: for each probe its number, and for the regions ``ghosts`` (error larger without
        separation) and ``outlines`` the ``count`` of pixels, their share ``pixels``, percent, their median
        velocity ``deg_s`` (None for an empty region), and comparisons by score, JND, and share above 1 JND,
        percent, in motion and as stills: ``unseparated against reference``, ``separated against reference``,
        ``unseparated against unfiltered`` (the paper's), and ``effect``, unseparated against separated.
    example : dict
        Images of the probe with most ghosts, as in Fig. 10: colours ``unfiltered``, ``unseparated``,
        ``separated`` and ``reference``, mask ``ghost``, JND of the effect in ``motion`` and ``still``,
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


def changed_pixels(viewer: Viewer, unseparated: F32, separated: F32) -> Mask:
    """Pixels that separation changes visibly, (H, W): those with samples of another surface."""
    changed: Mask = np.abs(viewer.luminance(unseparated) - viewer.luminance(separated)) > GHOST_CD_M2
    return changed


def _compare(windows: Windows, frame: int) -> tuple[dict[str, Any], Example]:
    view, viewer = windows.view(frame), windows.viewer
    settings = windows.walk.settings[AntialiasSettings]
    unfiltered, reference = windows.traced(frame).color, windows.reference(frame).color
    unseparated, separated = (
        windows.antialiased(frame, replace(settings, separate_shapes=separate)) for separate in (False, True)
    )
    changed, near = changed_pixels(viewer, unseparated, separated), outlines(view.geometry.shape_index)
    errors = [
        np.abs(viewer.luminance(image) - viewer.luminance(reference)) for image in (unseparated, separated)
    ]
    regions = {"ghosts": changed & ~near & (errors[0] > errors[1]), "outlines": changed & near}
    maps = {
        kind: {eye: viewer.paper(test, target, velocity) for eye, velocity in _velocities(view).items()}
        for kind, (test, target) in {
            "effect": (unseparated, separated),
            "unseparated against reference": (unseparated, reference),
            "separated against reference": (separated, reference),
            "unseparated against unfiltered": (unseparated, unfiltered),
        }.items()
    }
    row: dict[str, Any] = {"frame": windows.walk.path.numbers[frame]}
    for region, where in regions.items():
        row[region] = {
            "count": int(where.sum()),
            "pixels": 100.0 * float(where.mean()),
            "deg_s": float(np.median(view.speed_deg_s[where])) if where.any() else None,
            **{
                kind: {eye: scores_in(jnd, where) for eye, jnd in maps_by_eye.items()}
                for kind, maps_by_eye in maps.items()
            },
        }
    images = {
        "unseparated": unseparated,
        "separated": separated,
        "unfiltered": unfiltered,
        "reference": reference,
    }
    images |= maps["effect"]
    return row, {**images, "ghost": regions["ghosts"].astype(np.float32), "speed_deg_s": view.speed_deg_s}


def _velocities(view: View) -> dict[str, F32 | None]:
    return {"motion": view.velocity_deg_s, "still": None}
