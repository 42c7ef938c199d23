"""Twin of `enfilade.methods.decoupled.surface_edges`: two pixels at a time, float64."""

import numpy as np

from enfilade.gbuffer import positions


def surface_edges(geometry, *, crease_cosine, plane_tolerance, reach, min_support):
    """Edges, and thin surfaces, (H, W) bool each."""
    index = geometry.shape_index
    position, normal = positions(geometry).astype(float), geometry.normal.astype(float)
    height, width = index.shape

    def is_same(here, there):
        if index[here] != index[there]:
            return False
        if index[here] == 0:
            return True
        step = position[there] - position[here]
        tolerance = plane_tolerance * min(geometry.depth[here], geometry.depth[there])
        return bool(
            normal[here] @ normal[there] > crease_cosine
            and abs(step @ normal[here]) <= tolerance
            and abs(step @ normal[there]) <= tolerance
        )

    is_edge, is_thin = np.zeros((2, height, width), bool)
    for y, x in np.ndindex(height, width):
        support = 0
        for down, across in np.ndindex(2 * reach + 1, 2 * reach + 1):
            there = y + down - reach, x + across - reach
            if there == (y, x):
                continue
            is_inside = 0 <= there[0] < height and 0 <= there[1] < width
            same = not is_inside or is_same((y, x), there)
            support += same
            if abs(down - reach) + abs(across - reach) == 1 and not same:
                is_edge[y, x] = True
        is_thin[y, x] = support < min_support
    return is_edge, is_thin
