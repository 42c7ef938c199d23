"""The beauty layer of an OpenEXR file, which renderers and compositing programs name differently."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from enfilade.errors import ImageError
from enfilade.images.exr import color_layers
from enfilade.records import F32

BEAUTY_NAMES = {
    "rgb": 0,
    "rgba": 1,
    "beauty": 2,
    "c": 3,
    "combined": 4,
}  # by the last word
ADVICE = "choose the beauty layer with --layer (once for both sequences, or for the test, then the reference)"


def choose_layer(file: Path, wanted: str | None = None) -> tuple[str, str]:
    """Choose the beauty layer from the headers of a file.

    Parameters
    ----------
    file
    wanted
        A layer or part, by its whole name or the last word (`Combined` of `View Layer.Combined`), in any
        case. By default R G B without a name, else rgba, beauty, C or Combined, else the only layer of R G B.

    Returns
    -------
    name, note : str
        Of the layer, empty if the file has no R G B; and a note on the choice, where it is not obvious.

    Raises
    ------
    ImageError
        There is no such layer, or there are several candidates.
    """
    names = color_layers(file)
    if wanted is not None:
        return _named(file, names, wanted), ""
    if not names:
        return "", ""
    ranks = {name: BEAUTY_NAMES.get(_last_word(name), len(BEAUTY_NAMES)) for name in names}
    best = [name for name in names if ranks[name] == min(ranks.values())]
    if len(best) > 1:
        raise ImageError(f"{file} has the colour layers {', '.join(best)}; {ADVICE}")
    (name,) = best
    if len(names) == 1 or name == "RGB":
        return name, ""
    others = ", ".join(other for other in names if other != name)
    return name, f"colours: the layer {name} of {file}; --layer chooses another: {others}"


def beauty(file: Path, layers: dict[str, Any], name: str) -> F32:
    """Colours of a layer as (H, W, 3) float32, or of the luminance channel `Y` if its name is empty.

    Parameters
    ----------
    file
        For messages.
    layers, name
        From :func:`~enfilade.images.read_exr` and :func:`choose_layer`.

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
    alike = [name for name in names if wanted.lower() in (name.lower(), _last_word(name))]
    if len(alike) == 1:
        return alike[0]
    problem = f"several colour layers {wanted}" if alike else f"no colour layer {wanted}"
    raise ImageError(f"{file} has {problem}; it has the colour layers {', '.join(names) or 'none'}; {ADVICE}")


def _last_word(name: str) -> str:
    return name.rpartition(".")[2].lower()
