"""The Dr.Jit types of this package, and the way between them and NumPy.

They are the differentiable types, since those are Mitsuba's own: a camera ray, its surface query and
our arithmetic on it then fuse into one kernel. ``device.activate`` decides whether they live on the
CPU or on a GPU, and must come before the first import of this module.

On the CPU, NumPy and Dr.Jit share memory both ways, also where NumPy says read-only: scatter only
into arrays made in the same function.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np
import numpy.typing as npt
from drjit.auto.ad import (
    Array2f,
    Array3f,
    Array3f16,
    Array4f,
    Bool,
    Float,
    Float16,
    Float64,
    Int,
    Matrix3f,
    UInt,
    UInt64,
)

__all__ = [
    "Array2f",
    "Array3f",
    "Array3f16",
    "Array4f",
    "Bool",
    "Float",
    "Float64",
    "Int",
    "Matrix3f",
    "UInt",
    "UInt64",
    "image",
    "lanes",
    "matrix3",
    "opaque",
    "pixel_grid",
    "release_memory",
    "rows",
    "to_float",
    "to_half",
    "vector3",
]


ALIGNMENT = 64  # bytes, of Dr.Jit's memory
HALF_MAX = 65504.0  # largest finite half float, IEEE 754


def lanes(values: npt.NDArray[Any]) -> Any:
    """Flat lanes of a NumPy image, lane ``y * width + x``, or of a list.

    Parameters
    ----------
    values : (H, W) or (H, W, 2) or (H, W, 3) or (N,)
        float16, float32, int32, uint32, uint64, uint8 (widened to uint32) or bool. Other sizes are not taken.

    Returns
    -------
    Float16, Float, Int, UInt, Bool, Array2f, Array3f or Array3f16
        A copy for vectors (structure of arrays); memory may be shared for scalars.
    """
    match values.dtype.kind, values.dtype.itemsize:
        case "f", 2:
            scalar: Any = Float16
        case "f", 4:
            scalar = Float
        case "i", 4:
            scalar = Int
        case "u", 4:
            scalar = UInt
        case "u", 8:
            scalar = UInt64
        case "u", 1:
            return UInt(_aligned(values.astype(np.uint32)))
        case "b", _:
            scalar = Bool
        case _:
            raise TypeError(f"no Dr.Jit type for arrays of {values.dtype}")
    if values.ndim < 3:
        return scalar(_aligned(values))
    vector = {2: Array2f, 3: Array3f16 if scalar is Float16 else Array3f}[values.shape[2]]
    return vector(*(scalar(_aligned(c)) for c in values.reshape(-1, values.shape[2]).T))


def _aligned(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Flat values at an address as Dr.Jit's own memory has it; copied where they stand elsewhere.

    Kernels differ by the alignment of their inputs: NumPy's memory, aligned now and then, would have
    the same kernel compiled anew in the middle of a run.
    """
    flat = np.ascontiguousarray(values).ravel()
    if flat.ctypes.data % ALIGNMENT == 0:
        return flat
    room = np.empty(flat.nbytes + ALIGNMENT, np.uint8)
    start = -room.ctypes.data % ALIGNMENT
    aligned: npt.NDArray[Any] = room[start : start + flat.nbytes].view(flat.dtype)
    aligned[:] = flat
    return aligned


def image(values: Any, height: int, width: int) -> npt.NDArray[Any]:
    """NumPy image (H, W) or (H, W, C) of flat lanes; evaluates them; always a copy."""
    if dr.depth_v(values) == 1:
        return np.array(values).reshape(height, width)
    return rows(values).reshape(height, width, -1)


def rows(vectors: Any) -> npt.NDArray[Any]:
    """NumPy array (N, C) of vectors; evaluates them.

    Made by NumPy: Dr.Jit would compile a kernel for each N.
    """
    dr.eval(vectors)  # all axes by one kernel
    return np.stack([np.array(axis) for axis in vectors], axis=1)


def to_half(values: npt.NDArray[np.float32]) -> npt.NDArray[np.float16]:
    """Half floats nearest to the values, of their shape; those beyond the range become its ends.

    Several times as fast as NumPy's own.
    """
    narrow = Float16(dr.clip(lanes(values.ravel()), -HALF_MAX, HALF_MAX))
    return np.array(narrow).reshape(values.shape)


def to_float(values: npt.NDArray[np.float16]) -> npt.NDArray[np.float32]:
    """Half floats as 32-bit floats, of their shape."""
    return np.array(Float(Float16(_aligned(values)))).reshape(values.shape)


def opaque(value: float | int, kind: Any = None) -> Any:
    """A number as a one-element array, so that its value is not compiled into the kernel.

    A number that changes from frame to frame and reaches Dr.Jit as a literal costs a new compilation
    of some seconds for every frame.
    """
    kind = kind or (UInt if isinstance(value, int) else Float)
    return dr.opaque(kind, value)


def release_memory() -> None:
    """Give back the memory that Dr.Jit keeps for arrays of sizes it has seen."""
    dr.sync_thread()
    dr.flush_malloc_cache()


def pixel_grid(height: int, width: int) -> tuple[Any, Any, Any]:
    """Lane index, column and row of every pixel of an image."""
    lane = dr.arange(UInt, height * width)
    row = lane // opaque(width)
    return lane, lane - row * opaque(width), row


def vector3(values: npt.ArrayLike) -> Any:
    """Three numbers as a vector that is the same in all lanes and not compiled into the kernel."""
    return Array3f(*(opaque(float(v)) for v in np.asarray(values).ravel()))


def matrix3(values: npt.ArrayLike) -> Any:
    """Matrix (3, 3) that is the same in all lanes and not compiled into the kernel."""
    return Matrix3f(*(opaque(float(v)) for v in np.asarray(values).ravel()))
