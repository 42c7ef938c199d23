"""Records <-> layers of an OpenEXR file: shading, frames on their way, and the delivered frame (§5)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np
import numpy.typing as npt

from enfilade.errors import ImageError
from enfilade.images.exr import Array, read_attributes, read_exr, write_exr
from enfilade.records import F32, LOBE_LAYERS, U8, Frame, Mask, Shading

__all__ = [
    "read_frame",
    "read_light",
    "read_parts",
    "read_shading",
    "write_frame",
    "write_light",
    "write_parts",
    "write_result",
    "write_shading",
]

F16 = npt.NDArray[np.float16]
HALVES = frozenset({"N", "albedo"})  # layers for which eleven bits do


def write_shading(file: Path, shading: Shading) -> None:
    """Write the shading of an image, exactly.

    Parameters
    ----------
    file
    shading : Shading
        Of shape (H, W).

    Raises
    ------
    RunFolderError
        The file can't be written.
    """
    layers = {"RGB": shading.color, "variance": shading.variance}
    write_exr(file, layers, attributes={"dropped": str(int(shading.dropped))})


def read_shading(file: Path) -> Shading:
    """Read what :func:`write_shading` wrote, bit by bit the same.

    Raises
    ------
    ImageError
        The file is missing, damaged, or holds no shading.
    """
    layers = _required(file, {"RGB": np.float32, "variance": np.float32})
    return Shading(layers["RGB"], layers["variance"], _dropped(file))


def write_light(file: Path, direct: Shading, indirect: Shading, is_known: Mask) -> None:
    """Write the light of a page, exactly, and where it is known.

    Parameters
    ----------
    file
    direct, indirect : Shading
        Of shape (H, W); their samples are dropped together.
    is_known : (H, W) bool

    Raises
    ------
    RunFolderError
        The file can't be written.
    """
    layers = {
        "RGB": direct.color,
        "variance": direct.variance,
        "indirect": indirect.color,
        "indirect variance": indirect.variance,
        "known": is_known.astype(np.uint32),
    }
    write_exr(file, layers, attributes={"dropped": str(int(direct.dropped))})


def read_light(file: Path) -> tuple[Shading, Shading, Mask]:
    """Read what :func:`write_light` wrote, bit by bit the same.

    Raises
    ------
    ImageError
        The file is missing, damaged, or holds no light.
    """
    values = ("RGB", "variance", "indirect", "indirect variance")
    layers = _required(file, {**dict.fromkeys(values, np.float32), "known": np.uint32})
    dropped = _dropped(file)
    direct = Shading(layers["RGB"], layers["variance"], dropped)
    indirect = Shading(layers["indirect"], layers["indirect variance"], dropped)
    return direct, indirect, layers["known"] > 0


def write_parts(
    file: Path, seen: F32, scattered: Sequence[Shading], source: U8, dropped: int
) -> tuple[F32, list[Shading]]:
    """Write the parts of a frame's light, as half floats; of the variance, its root.

    Parameters
    ----------
    file
    seen : (H, W, 3) float32
        What surfaces emit and scatter diffusely.
    scattered : sequence of Shading
        What they scatter by other lobes: the first of ``records.LOBE_LAYERS``, or all.
    source : (H, W) uint8
        ``records.Source``.
    dropped
        Samples left out of all parts.

    Returns
    -------
    seen, scattered
        As :func:`read_parts` will find them.

    Raises
    ------
    RunFolderError
        The file can't be written.
    """
    layers: dict[str, Array] = {"RGB": _half(seen), "source": source.astype(np.uint32)}
    for name, layer in zip(LOBE_LAYERS[: len(scattered)], scattered, strict=True):
        layers |= {name: _half(layer.color), _deviation(name): _half(np.sqrt(layer.variance))}
    write_exr(file, layers, attributes={"dropped": str(int(dropped))})
    return _parts(layers, dropped=dropped)


def read_parts(file: Path) -> tuple[F32, list[Shading], U8]:
    """Read what :func:`write_parts` wrote.

    Raises
    ------
    ImageError
        The file is missing, damaged, or holds no such parts.
    """
    there = read_exr(file)
    names = [
        name for name in LOBE_LAYERS if name == LOBE_LAYERS[0] or {name, _deviation(name)} & there.keys()
    ]
    kinds = {layer: np.float16 for name in names for layer in (name, _deviation(name))}
    layers = _checked(file, there, {"RGB": np.float16, "source": np.uint32, **kinds})
    return *_parts(layers, dropped=_dropped(file)), layers["source"].astype(np.uint8)


def _parts(layers: Mapping[str, Array], *, dropped: int) -> tuple[F32, list[Shading]]:
    from enfilade.arrays import widened  # here, not above: who only reads pictures needs no Dr.Jit

    scattered = [
        Shading(widened(layers[name]), np.square(widened(layers[_deviation(name)])), dropped)
        for name in LOBE_LAYERS
        if name in layers
    ]
    return widened(layers["RGB"]), scattered


def _deviation(name: str) -> str:
    return f"{name} deviation"


def _dropped(file: Path) -> int:
    dropped = str(read_attributes(file).get("dropped", ""))
    if not dropped.isascii() or not dropped.isdigit():
        raise ImageError(f"{file} doesn't say how many samples were dropped; delete it to make it again")
    return int(dropped)


def write_frame(file: Path, frame: Frame) -> None:
    """Write a frame on its way to the video, exactly.

    Raises
    ------
    RunFolderError
        The file can't be written.
    """
    write_exr(file, {"RGB": frame.color, "source": frame.source.astype(np.uint32)})


def read_frame(file: Path) -> Frame:
    """Read what :func:`write_frame` wrote, bit by bit the same.

    Raises
    ------
    ImageError
        The file is missing, damaged, or holds no frame.
    """
    layers = _required(file, {"RGB": np.float32, "source": np.uint32})
    return Frame(layers["RGB"], layers["source"].astype(np.uint8))


def write_result(
    file: Path,
    color: F32,
    layers: Mapping[str, Array],
    *,
    attributes: Mapping[str, str | float | int | Fraction] | None = None,
) -> None:
    """Write a delivered frame, in formats that other programs read.

    ``R G B``, ``N`` and ``albedo`` are half floats, other floats are rounded to 16 significant bits: a point
    10 m away to 0.2 mm; keep a scene near its origin. Integers are kept.

    Parameters
    ----------
    file
    color : (H, W, 3) float32
        Linear Rec.709. Values beyond the range of a half float become its ends.
    layers
        Those that go with it, by names of ``settings.LAYERS``; see :func:`~enfilade.images.exr.write_exr`.
    attributes
        Of the header.

    Raises
    ------
    RunFolderError
        The file can't be written.
    """
    written = {name: _half(array) if name in HALVES else array for name, array in layers.items()}
    write_exr(file, {"RGB": _half(color), **written}, attributes=attributes, is_portable=True)


def _half(values: F32) -> F16:
    from enfilade.arrays import halves  # here, not above: who only reads pictures needs no Dr.Jit

    return halves(values)


def _required(file: Path, kinds: Mapping[str, type]) -> dict[str, Array]:
    return _checked(file, read_exr(file), kinds)


def _checked(file: Path, layers: dict[str, Array], kinds: Mapping[str, type]) -> dict[str, Array]:
    for name, kind in kinds.items():
        if name not in layers or layers[name].dtype != kind:
            raise ImageError(
                f"{file} has no layer {name!r} of {kind.__name__} (it has {', '.join(layers)}); "
                "delete it to make it again"
            )
    return layers
