# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of a material and its object while its BSDFs are made."""

from __future__ import annotations

from dataclasses import dataclass

from enfilade_blender.materials.textures import Textures
from enfilade_blender.notes import Notes


@dataclass(frozen=True)
class Context:
    """What functions that make BSDFs need: the material's name, textures and notes; how normals lie."""

    owner: str
    textures: Textures
    notes: Notes
    is_mirrored: bool = False  # the UV map, below normal maps
    is_back: bool = False  # the side of a surface that normals point away from
    is_solid: bool = False  # the object is closed, and no pane
    is_sheet: bool = False  # glass without a back
    uv_density: float = 1.0  # texture coordinates for each scene unit
