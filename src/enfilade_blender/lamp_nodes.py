# SPDX-License-Identifier: GPL-3.0-or-later
"""What the nodes of lamps make of their light: a factor of constants."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from enfilade_blender.ies import mean_factor
from enfilade_blender.job import Job
from enfilade_blender.materials.bake_scene import BakeScene
from enfilade_blender.materials.graph import Graph
from enfilade_blender.materials.links import upstream
from enfilade_blender.materials.table import COLOUR_NODES
from enfilade_blender.materials.values import Add, Constant, Emission, Mix, Nothing, Procedural, Shader, Value
from enfilade_blender.notes import Notes
from enfilade_blender.open_file import is_allowed
from enfilade_blender.records import Lamp, Selection


class LampNodes:
    """Reads nodes of lamps; Cycles evaluates what they compute of constants.

    Parameters
    ----------
    job, selection, notes
    """

    def __init__(self, job: Job, selection: Selection, notes: Notes) -> None:
        self._job, self._frame, self._notes = job, selection.frames[0], notes
        self._stage: BakeScene | None = None
        self._computed: dict[Any, Constant] = {}  # by outputs: lamps may share their nodes

    def factor(self, lamp: Lamp) -> tuple[float, float, float]:
        """Factor of a lamp's nodes: the sum of emissions, of colours and strengths that are constants."""
        tree = lamp.data.node_tree if lamp.data.use_nodes else None
        if tree is None:
            return 1.0, 1.0, 1.0
        output = tree.get_output_node("CYCLES")
        graph = Graph(lamp.name, self._notes)
        shader = graph.shader(output.inputs["Surface"], ()) if output else Nothing()
        r, g, b = self._emitted(shader, lamp)
        return float(r), float(g), float(b)

    def _emitted(self, shader: Shader, lamp: Lamp) -> np.ndarray:
        """Light of a shader (3,); of others than emissions none."""
        if isinstance(shader, Emission):
            colour, strength = (self._known(v, 1.0, lamp) for v in (shader.colour, shader.strength))
            return np.array(colour.colour) * strength.number
        if not isinstance(shader, Add | Mix):
            return np.zeros(3)
        first, second = (self._emitted(part, lamp) for part in (shader.first, shader.second))
        if isinstance(shader, Add):
            return first + second
        share = min(max(self._known(shader.factor, 0.5, lamp).number, 0.0), 1.0)
        return (1.0 - share) * first + share * second

    def _known(self, value: Value, instead: float, lamp: Lamp) -> Constant:
        """A constant, or what nodes compute of constants; a number in place of a pattern, with a note."""
        if isinstance(value, Constant):
            return value
        if (mean := self._mean_of_profile(value, lamp)) is not None:
            what, effect = "its IES profile is averaged", "light is even in all directions"
            self._notes.add("approximated", lamp.name, "Nodes", what, effect)
            return Constant((mean,))
        if isinstance(value, Procedural) and all(
            of.node.type in COLOUR_NODES for of in upstream(value.output)
        ):
            groups = tuple(group.as_pointer() for group in value.output.groups)
            key = value.output.socket.as_pointer(), groups
            if key not in self._computed:
                self._stage = self._stage or BakeScene(self._job.bake_samples, self._frame)
                self._computed[key] = Constant(self._stage.light_colour(lamp.data, value.output))
            return self._computed[key]
        what, effect = "a pattern of its nodes is left out", "light is even, and may be brighter or darker"
        self._notes.add("not-carried", lamp.name, "Nodes", what, effect)
        return Constant((instead,))

    def _mean_of_profile(self, value: Value, lamp: Lamp) -> float | None:
        """Mean factor of an IES Texture of constant strength; None of others, or if it can't be read."""
        if not isinstance(value, Procedural) or value.output.node.type != "TEX_IES":
            return None
        node, data = value.output.node, lamp.data
        strength = node.inputs["Strength"]
        if strength.is_linked or data.type == "SUN":
            return None
        if node.mode == "INTERNAL":
            text = node.ies.as_string() if node.ies else ""
        else:
            file = Path(bpy.path.abspath(node.filepath, library=node.id_data.library)).resolve()
            is_there = file.is_file() and is_allowed(file, self._job)
            text = file.read_text(errors="replace") if is_there else ""
        factor = mean_factor(text, data.type, getattr(data, "spot_size", math.pi))
        return None if factor is None else factor * float(strength.default_value)
