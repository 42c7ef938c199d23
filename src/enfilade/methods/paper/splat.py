"""Forward splatting into a z-buffer: each source pixel covers the parallelogram that it stretches to.

Shade et al. (1998) size splats by depth and orientation. Here a splat is the Jacobian of the warp on the
surface's own plane, so that the splats of a plane tile it: there are no pinholes, and no bleeding over
silhouettes beyond `OVERLAP`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from enfilade.arrays import Bool, Float, Int, UInt, UInt64

OVERLAP = 0.05  # of a splat with its neighbours, source pixels: closes hairline cracks
EMPTY = 0xFFFF_FFFF_FFFF_FFFF  # key of a target pixel without a splat
INFINITE = 3.0e38  # depth of surfaces at infinity in the z-buffer


@dataclass(frozen=True)
class Splats:
    """Source pixels, stretched by a warp to parallelograms; lanes of the source.

    Attributes
    ----------
    x, y : Float
        Positions of the pixels' centres, target pixels.
    inverse_depth : Float
        One over the depth there, seen from the target; 0 at infinity.
    by_x, by_y : Array2f
        Columns of the Jacobian: target pixels by source pixel.
    slope : Array2f
        Derivative of the target's inverse depth by source pixel.
    is_splat : Bool
        Source pixels that take part.
    """

    x: Any
    y: Any
    inverse_depth: Any
    by_x: Any
    by_y: Any
    slope: Any
    is_splat: Any


def splat_nearest(splats: Splats, *, width: int, height: int, reach: float) -> Any:
    """Find the nearest splat over each pixel's centre.

    Parameters
    ----------
    splats
    width, height
        Of the target.
    reach
        Largest half extent of the box around a splat, target pixels. Larger splats are left out, which bounds
        the cost.

    Returns
    -------
    UInt64, width * height
        Depth (as the bits of a positive float) in the upper half, source lane in the lower half: the smallest
        key is the nearest splat, in any order. `EMPTY` where there is none.
    """
    x, y, by_x, by_y = splats.x, splats.y, splats.by_x, splats.by_y
    keys = dr.full(UInt64, EMPTY, width * height)
    lane = dr.arange(UInt, dr.width(x))

    # Invert the Jacobian: target offset -> source offset. A surface seen from behind has none.
    det = by_x.x * by_y.y - by_y.x * by_x.y
    is_facing = splats.is_splat & (det > 1e-6)
    scale = dr.select(is_facing, 1.0 / det, 0.0)

    # Find the target pixels whose centres lie in the splat's bounding box.
    half_x = (0.5 + OVERLAP) * (dr.abs(by_x.x) + dr.abs(by_y.x))
    half_y = (0.5 + OVERLAP) * (dr.abs(by_x.y) + dr.abs(by_y.y))
    is_facing &= (half_x <= reach) & (half_y <= reach)
    is_facing &= (x + half_x > 0) & (x - half_x < width) & (y + half_y > 0) & (y - half_y < height)
    first_x = dr.maximum(Int(dr.ceil(x - half_x - 0.5)), 0)
    first_y = dr.maximum(Int(dr.ceil(y - half_y - 0.5)), 0)
    last_x = dr.minimum(Int(dr.floor(x + half_x - 0.5)), Int(width - 1))
    last_y = dr.minimum(Int(dr.floor(y + half_y - 0.5)), Int(height - 1))

    def cover(column: Any, row: Any) -> None:
        # Test whether the target's centre lies in the source pixel.
        dx, dy = Float(column) + 0.5 - x, Float(row) + 0.5 - y
        s = scale * (by_y.y * dx - by_y.x * dy)
        t = scale * (by_x.x * dy - by_x.y * dx)
        is_inside = (dr.abs(s) <= 0.5 + OVERLAP) & (dr.abs(t) <= 0.5 + OVERLAP)

        # Write the depth of the plane there, as an integer of the same order.
        nearness = splats.inverse_depth + s * splats.slope.x + t * splats.slope.y
        depth = dr.select(nearness > 1.0 / INFINITE, 1.0 / nearness, INFINITE)
        bits = dr.reinterpret_array(UInt, depth)
        key = (UInt64(bits) << 32) | UInt64(lane)
        target = UInt(row * width + column)
        dr.scatter_reduce(dr.ReduceOp.Min, keys, key, target, is_inside)

    # Cover the pixels of the box one after the other.
    column, row = Int(first_x), Int(first_y)
    is_open = is_facing & (first_x <= last_x) & (first_y <= last_y)

    def step(column: Any, row: Any, is_open: Any) -> tuple[Any, Any, Any]:
        cover(column, row)
        is_last = column >= last_x
        row = dr.select(is_last, row + 1, row)
        column = dr.select(is_last, first_x, column + 1)
        return column, row, is_open & (row <= last_y)

    dr.while_loop(
        state=(column, row, Bool(is_open)),
        cond=lambda _column, _row, is_open: is_open,
        body=step,
        label="splat",
    )
    return keys
