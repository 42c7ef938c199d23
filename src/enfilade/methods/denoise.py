"""Open Image Denoise (Áfra, https://www.openimagedenoise.org), by ``pyoidn``, which includes its weights."""

from __future__ import annotations

from importlib.metadata import version
from importlib.util import find_spec
from typing import Any

import numpy as np

from enfilade.errors import SettingsError
from enfilade.records import F32


def denoise(color: F32, albedo: F32, normal: F32, *, quality: str = "high") -> F32:
    """Denoise an HDR image on the CPU, with noise-free guides.

    Parameters
    ----------
    color : (H, W, 3) float32
        Linear radiance, box filtered as the training data of the networks. Negative values count as 0.
    albedo : (H, W, 3) float32
        0..1, filtered as the colours.
    normal : (H, W, 3) float32
        In world space, -1..1, filtered as the colours.
    quality : {"high", "balanced", "fast"}
        Of the network.

    Returns
    -------
    (H, W, 3) float32

    Raises
    ------
    SettingsError
        ``pyoidn`` is not installed.

    Notes
    -----
    About 5 microseconds of CPU time a pixel at its highest quality, 1 at its fastest.
    """
    pyoidn = _library()
    guides = {
        name: np.ascontiguousarray(a, np.float32) for name, a in (("albedo", albedo), ("normal", normal))
    }
    found: F32 = pyoidn.denoise(
        np.maximum(color, np.float32(0.0)), **guides, hdr=True, clean_aux=True, quality=quality
    )
    return found


def denoise_displayed(color: F32) -> F32:
    """Denoise an image as it is displayed, on the CPU, without guides.

    Parameters
    ----------
    color : (H, W, 3) float32
        Linear, 0..1, 1 = white.

    Returns
    -------
    (H, W, 3) float32

    Raises
    ------
    SettingsError
        ``pyoidn`` is not installed.

    Notes
    -----
    About 2 microseconds of CPU time a pixel.
    """
    pyoidn = _library()
    found: F32 = pyoidn.denoise(np.ascontiguousarray(color, np.float32), hdr=False, quality="balanced")
    return found


def _library() -> Any:
    if why := why_no_denoiser():
        raise SettingsError(why)
    import pyoidn

    return pyoidn


def denoiser_name() -> str:
    """Name and version of the denoiser."""
    return f"Open Image Denoise (pyoidn {version('pyoidn')})"


def why_no_denoiser() -> str:
    """The reason why the denoiser is not available, with the remedy; empty if it is."""
    if find_spec("pyoidn") is None:
        return "Open Image Denoise is not installed: pip install pyoidn"
    return ""
