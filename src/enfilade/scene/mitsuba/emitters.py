"""Points on the emitters of a Mitsuba scene."""

from __future__ import annotations

import mitsuba as mi
import numpy as np

from enfilade.arrays import Array3f, rows
from enfilade.kernels.random import one_sequence
from enfilade.renderer import Emitters
from enfilade.scene.mitsuba.merge import MergedScene
from enfilade.scene.mitsuba.shapes import is_lamp

MAX_POINTS = 1 << 17  # on all emitters together
POINTS = 64, 1024  # fewest and most on one


def find_emitters(merged: MergedScene) -> Emitters:
    """Distribute points over all emitting surfaces; lamps, environments and delta emitters have none."""
    numbered = zip(merged.sources, merged.scene.shapes(), strict=True)
    visible = [pair for pair in numbered if pair[1].is_emitter() and not is_lamp(pair[1])]
    shapes = [(int(source[0]), shape) for source, shape in visible]
    count = int(np.clip(MAX_POINTS // max(len(shapes), 1), *POINTS))
    sample_points = mi.Point2f(one_sequence(count).next_2d())
    points = [rows(Array3f(shape.sample_position(0.0, sample_points).p)) for _, shape in shapes]
    return Emitters(
        np.concatenate([np.zeros((0, 3), np.float32), *points]),
        np.repeat(np.array([index for index, _ in shapes], np.uint32), count),
    )
