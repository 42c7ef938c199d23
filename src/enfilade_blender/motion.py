# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds objects that move or deform: the exported scene is static."""

from __future__ import annotations

from typing import Any

import numpy as np

from enfilade_blender.notes import Notes
from enfilade_blender.records import Selection

SAMPLES = 5  # frames at which poses are compared
LISTED = 20  # objects that are named
TOLERANCE = 1e-5
DEFORMING = ("ARMATURE", "MESH_CACHE", "MESH_SEQUENCE_CACHE", "CLOTH", "SOFT_BODY", "OCEAN", "WAVE", "FLUID")


def note_motion(selection: Selection, notes: Notes) -> None:
    """Note every object but cameras whose pose or shape changes over the frames."""
    first, last = selection.frames
    if first == last:
        return
    frames = sorted({int(frame) for frame in np.linspace(first, last, SAMPLES)})
    poses = [_poses(selection, frame) for frame in frames]
    moving = [
        name for name, pose in poses[0].items() if any(_differs(pose, later.get(name)) for later in poses[1:])
    ]
    deforming = [obj.name for obj in selection.scene.objects if obj.name not in moving and _deforms(obj)]
    effect = f"it stays as in frame {first}"
    for name in moving[:LISTED]:
        notes.add("not-carried", name, "Animation", "its motion is left out", effect)
    for name in deforming[:LISTED]:
        notes.add("not-carried", name, "Animation", "its deformation is left out", effect)
    rest = max(len(moving) - LISTED, 0) + max(len(deforming) - LISTED, 0)
    if rest:
        notes.add("not-carried", f"{rest} further objects", "Animation", "their motion is left out", effect)
    selection.scene.frame_set(first)


def _poses(selection: Selection, frame: int) -> dict[str, np.ndarray]:
    selection.scene.frame_set(frame)
    return {obj.name: np.array(obj.matrix_world) for obj in selection.scene.objects if obj.type != "CAMERA"}


def _differs(pose: np.ndarray, other: Any) -> bool:
    return other is not None and bool(np.abs(pose - other).max() > TOLERANCE)


def _deforms(obj: Any) -> bool:
    keys = getattr(obj.data, "shape_keys", None)
    has_keys = keys is not None and keys.animation_data is not None
    return has_keys or any(modifier.type in DEFORMING and modifier.show_render for modifier in obj.modifiers)
