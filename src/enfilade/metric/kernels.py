"""Dr.Jit kernel of the modern mode's per-pixel part: weights, energies and their sums, in one launch.

What `Decision` does with NumPy (weigh, `transducer.energy_difference`, `Aperture.coarse`) in a dozen passes
over memory. It runs where `device.activate` says, on the CPU or on a GPU; the transforms stay with SciPy.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import drjit as dr
import numpy as np
import numpy.typing as npt

from enfilade.arrays import Float, UInt, image, lanes, opaque

__all__ = ["MOST_SUMMED", "gathered_energies"]

Float32Array: TypeAlias = npt.NDArray[np.float32]

MOST_SUMMED = 8  # samples to a side that one lane sums: the loop is unrolled


def gathered_energies(
    reference: Float32Array,
    difference: Float32Array,
    weight: Float32Array,
    *,
    weight_step: int,
    start: int,
    shape: tuple[int, int],
    summed: int,
) -> tuple[Float32Array, Float32Array, Float32Array]:
    """Energies of a channel in both images, and of what differs, averaged over squares of samples.

    Parameters
    ----------
    reference, difference : (padded height, padded width) float32
        The channel of the reference, and of test - reference, as the transform gives them.
    weight : () or (h', w') float32
        What contrasts are multiplied by: one for all, or a map.
    weight_step : int
        1 where the map has every sample, 2 where it has every second (`pyramid.halved_shape`) and is
        interpolated bilinearly.
    start : int
        First row and column that count.
    shape : tuple of int
        Height and width that count.
    summed : int
        Side of the squares in samples, a power of two up to MOST_SUMMED.

    Returns
    -------
    energy_reference, energy_test, difference : (ceil(height / summed), ceil(width / summed)) float32
        Means of c''^2, c'^2 and abs(c' abs(c') - c'' abs(c'')); nothing lies beyond the borders.
    """
    height, width = shape
    rows, columns = -(-height // summed), -(-width // summed)
    spread = 0 if weight.ndim == 0 else weight_step
    numbers = (reference.shape[1], start, columns, height, width, weight.shape[1] if spread else 1)
    planes = (lanes(reference), lanes(difference), lanes(np.ascontiguousarray(weight).reshape(-1)))
    lane = dr.arange(UInt, rows * columns)
    sums = _kernel(planes, lane, tuple(opaque(number) for number in numbers), summed, spread)
    dr.eval(*sums)
    energy_reference, energy_test, changed = (image(total, rows, columns) for total in sums)
    return energy_reference, energy_test, changed


@dr.freeze
def _kernel(planes: Any, lane: Any, numbers: Any, summed: int, spread: int) -> Any:
    reference, difference, weight = planes
    stride, start, columns, height, width, weight_stride = numbers
    row, column = lane // columns, lane % columns
    energy_reference, energy_test, changed = Float(0.0), Float(0.0), Float(0.0)
    for down in range(summed):
        y = row * summed + down
        for across in range(summed):
            x = column * summed + across
            # Fetch both contrasts in units of their threshold.
            is_inside = (y < height) & (x < width)
            at = (y + start) * stride + x + start
            scale = _weight_at(weight, y, x, weight_stride, spread, is_inside)
            before = dr.gather(Float, reference, at, is_inside) * scale
            after = before + dr.gather(Float, difference, at, is_inside) * scale
            # Add their energies.
            energy_reference += before * before
            energy_test += after * after
            changed += dr.abs(after * dr.abs(after) - before * dr.abs(before))
    share = 1.0 / summed**2
    return energy_reference * share, energy_test * share, changed * share


def _weight_at(weight: Any, y: Any, x: Any, stride: Any, spread: int, is_inside: Any) -> Any:
    """The weight of a sample: 0 beyond the borders."""
    if spread == 0:
        return dr.gather(Float, weight, UInt(0), is_inside)
    if spread == 1:
        return dr.gather(Float, weight, y * stride + x, is_inside)
    first = (y >> 1) * stride + (x >> 1)
    right, below = x & 1, (y & 1) * stride  # the next sample, or this one again
    corners = (first, first + right, first + below, first + below + right)
    return 0.25 * sum((dr.gather(Float, weight, corner, is_inside) for corner in corners), Float(0.0))
