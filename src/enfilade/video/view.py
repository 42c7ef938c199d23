"""View transforms: from scene-linear Rec.709 to the values that a video stores."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from enfilade.errors import SettingsError
from enfilade.pixels.tone import srgb_encode
from enfilade.records import F32
from enfilade.settings import VideoSettings

__all__ = ["BT709_TRANSFER", "SRGB_TRANSFER", "View", "open_view"]

BT709_TRANSFER = 1  # ITU-T H.273, table 3
SRGB_TRANSFER = 13  # ITU-T H.273, table 3: IEC 61966-2-1
LINEAR_REC709 = (
    "Linear Rec.709 (sRGB)",
    "lin_rec709",
    "Linear Rec.709",
    "lin_srgb",
    "Utility - Linear - sRGB",
)
DISPLAYS = (("srgb", SRGB_TRANSFER), ("rec.1886", BT709_TRANSFER), ("rec.709", BT709_TRANSFER))


@dataclass(frozen=True)
class View:
    """A view transform.

    Attributes
    ----------
    encode : callable
        (H, W, 3) float32 scene-linear Rec.709 -> encoded values, 0..1, Rec.709 primaries.
    transfer : int
        What the encoded values are tagged with, ITU-T H.273, table 3.
    """

    encode: Callable[[F32], F32]
    transfer: int


def open_view(settings: VideoSettings, exposure_ev: float) -> View:
    """Make the view transform of the settings: sRGB, or one of an OpenColorIO configuration.

    Parameters
    ----------
    settings
        ``ocio`` and ``view`` choose; without a view, the default one of the display. The display is the
        configuration's first one for sRGB, else for Rec.1886 or Rec.709: wide-gamut and HDR displays
        aren't encoded.
    exposure_ev
        Stops, before the transform.

    Raises
    ------
    SettingsError
        OpenColorIO is not installed, or the configuration has no such view, no usable display, or no
        name for linear Rec.709.
    """
    gain = np.float32(2.0**exposure_ev)
    if not settings.ocio:
        if settings.view:
            raise SettingsError(
                f"[video] view = {settings.view!r} needs a configuration: set [video] ocio too"
            )
        return View(lambda linear: srgb_encode(np.clip(linear * gain, 0.0, 1.0)), SRGB_TRANSFER)
    apply, transfer = _open_ocio(settings.ocio, settings.view)
    return View(lambda linear: apply(np.ascontiguousarray(linear * gain, np.float32)), transfer)


def _open_ocio(file: str, view: str) -> tuple[Callable[[F32], F32], int]:
    try:
        import PyOpenColorIO
    except ImportError as error:
        raise SettingsError(
            "[video] ocio needs OpenColorIO, which is not installed: pip install 'enfilade[ocio]'"
        ) from error
    try:
        config = PyOpenColorIO.Config.CreateFromFile(file)
        display, transfer = _display(config, file)
        views = list(config.getViews(display))
        chosen = view or config.getDefaultView(display)
        if chosen not in views:
            raise SettingsError(f"{file} has no view {chosen!r} of {display!r}; it has: {', '.join(views)}")
        processor = config.getProcessor(
            _linear_rec709(config, file), display, chosen, PyOpenColorIO.TRANSFORM_DIR_FORWARD
        ).getDefaultCPUProcessor()
    except (PyOpenColorIO.Exception, PyOpenColorIO.ExceptionMissingFile) as error:
        raise SettingsError(f"OpenColorIO can't use {file}: {error}") from error

    def apply(linear: F32) -> F32:
        processor.applyRGB(linear)
        return np.clip(linear, 0.0, 1.0)

    return apply, transfer


def _display(config: Any, file: str) -> tuple[str, int]:
    names = list(config.getDisplays())
    for start, transfer in DISPLAYS:
        for name in names:
            if name.lower().startswith(start):
                return name, transfer
    raise SettingsError(f"{file} has no display for sRGB or Rec.709; it has: {', '.join(names)}")


def _linear_rec709(config: Any, file: str) -> str:
    for name in LINEAR_REC709:
        space = config.getColorSpace(name)
        if space is not None:
            return str(space.getName())
    raise SettingsError(f"{file} has no colour space for linear Rec.709, such as {LINEAR_REC709[0]!r}")
