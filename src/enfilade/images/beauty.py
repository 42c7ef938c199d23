"""Which layer of an OpenEXR file is the picture; renderers and compositing programs name it differently."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from enfilade.errors import ImageError
from enfilade.images.exr import color_layers
from enfilade.records import F32

__all__ = ["choose_layer", "picture_in"]

PICTURES = ("rgb", "rgba", "beauty", "c", "combined")  # last word of a name, the best first
ASK = "say by --layer which is the picture (once for both sequences, or for the test, then the reference)"


def choose_layer(file: Path, wanted: str | None = None) -> tuple[str, str]:
    """Choose a layer by the headers of a file.

    Parameters
    ----------
    file
    wanted
        A layer or part, whole or its last word (`Combined` of `View Layer.Combined`), in any case.
        By default R G B without a name, else what is called rgba, beauty, C or Combined, else the only one
        of three channels.

    Returns
    -------
    name : str
        Of the layer; empty where the file has none of R G B.
    note : str
        What was chosen where that is not plain; else empty.

    Raises
    ------
    ImageError
        There is no such layer, or nothing tells which of several is the picture.
    """
    names = color_layers(file)
    if wanted is not None:
        return _named(file, names, wanted), ""
    if not names:
        return "", ""
    ranks = [_rank(name) for name in names]
    best = [name for name, rank in zip(names, ranks, strict=True) if rank == min(ranks)]
    if len(best) > 1:
        raise ImageError(f"{file} has the colour layers {', '.join(best)}; {ASK}")
    (name,) = best
    if len(names) == 1 or name == "RGB":
        return name, ""
    others = ", ".join(other for other in names if other != name)
    return name, f"colours: the layer {name} of {file}; --layer chooses another: {others}"


def picture_in(file: Path, layers: dict[str, Any], name: str) -> F32:
    """Colours of a layer, or of the luminance channel `Y`, linear Rec.709.

    Parameters
    ----------
    file
        For messages.
    layers
        From :func:`~enfilade.images.read_exr`.
    name
        From :func:`choose_layer`.

    Returns
    -------
    (H, W, 3) float32

    Raises
    ------
    ImageError
        There is no such layer, or it holds no colours.
    """
    if name in layers and layers[name].ndim == 3 and layers[name].dtype.kind == "f":
        rgb: F32 = layers[name].astype(np.float32, copy=False)
        return rgb
    if name:
        raise ImageError(
            f"{file} has no layer {name} of R G B, all three half or float and of one size; it has the "
            f"layers {', '.join(layers)}"
        )
    if "Y" in layers and not {"RY", "BY"} & set(layers):
        return np.repeat(layers["Y"].astype(np.float32)[..., None], 3, axis=2)
    raise ImageError(f"{file} has no channels R G B; it has the layers {', '.join(layers)}")


def _named(file: Path, names: tuple[str, ...], wanted: str) -> str:
    if wanted in names:
        return wanted
    alike = [n for n in names if wanted.lower() in (n.lower(), _last_word(n))]
    if len(alike) == 1:
        return alike[0]
    if alike:
        raise ImageError(f"{file} has several colour layers {wanted}: {', '.join(alike)}; {ASK}")
    listed = f"the colour layers {', '.join(names)}" if names else "no layer of R G B"
    raise ImageError(f"{file} has no colour layer {wanted}; it has {listed}; {ASK}")


def _rank(name: str) -> int:
    word = _last_word(name)
    return PICTURES.index(word) if word in PICTURES else len(PICTURES)


def _last_word(name: str) -> str:
    return name.rpartition(".")[2].lower()
