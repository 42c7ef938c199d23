"""Twin of `enfilade.methods.paper.temporal_filter`: one pixel followed from frame to frame, float64."""

import math

import numpy as np

from twins.bilinear import interpolated


def filtered(frame, earlier, later, reach, least, *, separate_shapes=False):
    """Colours (H, W, 3) of `frame`, averaged along its trajectories."""
    height, width = reach.shape
    out = np.zeros((height, width, 3))
    for row in range(height):
        for column in range(width):
            total = frame.color[row, column].astype(float)
            weights = 1.0
            for neighbours, direction in ((earlier, "backward"), (later, "forward")):
                for distance, color in _walk(
                    frame, neighbours, direction, (column, row), reach, least, separate_shapes
                ):
                    w = math.exp(-0.5 * (distance / ((2 * reach[row, column] + 1) / 6)) ** 2)
                    total = total + w * color
                    weights += w
            out[row, column] = total / weights
    return out


def _walk(frame, neighbours, direction, pixel, reach, least, separate_shapes):
    height, width = reach.shape
    column, row = pixel
    x, y, travelled = column + 0.5, row + 0.5, 0.0
    shape_index, depth = frame.geometry.shape_index[row, column], float(frame.geometry.depth[row, column])
    present = frame
    for distance, following in enumerate(neighbours, start=1):
        if distance > reach[row, column]:
            return
        if distance > least[row, column] and travelled >= 0.5:
            return
        flow = interpolated(getattr(present.flow, direction), x, y)
        opposite = getattr(following.flow, "forward" if direction == "backward" else "backward")
        x, y = x + flow[0], y + flow[1]
        travelled += math.hypot(*flow)
        if not (0 <= x < width and 0 <= y < height):
            return
        if separate_shapes:
            there = following.geometry
            there_depth = float(there.depth[int(y), int(x)])
            is_same = there.shape_index[int(y), int(x)] == shape_index
            is_same &= abs(there_depth - depth) <= 0.05 * depth
            if not is_same and distance * math.hypot(*(flow + opposite[int(y), int(x)])) >= 0.5:
                return
            depth = there_depth if is_same else depth
        yield distance, interpolated(following.color, x, y)
        present = following
