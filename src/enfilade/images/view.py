"""View transforms: from scene-linear Rec.709 to the values that a video stores."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.errors import SettingsError
from enfilade.kernels.tone import compressed, srgb_encode
from enfilade.records import F32
from enfilade.settings import VideoSettings

BT709_TRANSFER = 1  # ITU-T H.273, table 3
SRGB_TRANSFER = 13  # ITU-T H.273, table 3: IEC 61966-2-1
LINEAR_REC709 = (
    "Linear Rec.709 (sRGB)", "lin_rec709", "Linear Rec.709", "lin_srgb", "Utility - Linear - sRGB",
)  # fmt: skip
WHITES = np.exp2(np.arange(0.0, 8.5, 0.5))  # exposed luminances that a view may show as white
DISPLAYS = (("srgb", SRGB_TRANSFER), ("rec.1886", BT709_TRANSFER), ("rec.709", BT709_TRANSFER))


@dataclass(frozen=True)
class ViewTransform:
    """A view transform.

    Attributes
    ----------
    encode : callable
        (H, W, 3) float32 scene-linear Rec.709 -> encoded values, 0..1, Rec.709 primaries.
    transfer : int
        Colour tag of the encoded values, ITU-T H.273, table 3.
    """

    encode: Callable[[F32], F32]
    transfer: int


def open_view(settings: VideoSettings, exposure_ev: float) -> ViewTransform:
    """Make the view transform of the settings: sRGB, or one of an OpenColorIO configuration.

    Parameters
    ----------
    settings
        ``ocio``, ``display``, ``view`` and ``look`` count. By default the display is the first one for sRGB,
        Rec.1886 or Rec.709, and the view its default one; wide-gamut and HDR displays are not supported.
    exposure_ev
        Stops, before the transform.

    Raises
    ------
    SettingsError
        OpenColorIO is not installed, or the configuration has no such view, no usable display, or no
        colour space for linear Rec.709.
    """
    gain = np.float32(2.0**exposure_ev)
    if not settings.ocio:
        for name in ("view", "display", "look"):
            if value := getattr(settings, name):
                raise SettingsError(f"[video] {name} = {value!r} needs a configuration: set [video] ocio too")
        return ViewTransform(lambda linear: srgb_encode(np.clip(linear * gain, 0.0, 1.0)), SRGB_TRANSFER)
    processor, transfer = _open_ocio(settings)
    apply = processor.getDefaultCPUProcessor().applyRGB

    def encode(linear: F32) -> F32:
        values = np.ascontiguousarray(linear * gain, np.float32)
        apply(values)
        return np.clip(values, 0.0, 1.0)

    return ViewTransform(encode, transfer)


def white_of(settings: VideoSettings) -> float:
    """White of the extended curve of Reinhard et al. 2002 that is nearest to a view's, for neutral colours.

    1 for sRGB, 8 for Blender's AgX; errors as above.
    """
    luminances = np.exp2(np.arange(-7.0, 7.25, 0.25)).astype(np.float32)
    shown = open_view(settings, 0.0).encode(np.repeat(luminances[None, :, None], 3, axis=2))[0, :, 1]
    curves = [srgb_encode(np.minimum(compressed(luminances, white), 1.0)) for white in WHITES]
    return float(WHITES[np.argmin([np.abs(curve - shown).max() for curve in curves])])


def view_identity(settings: VideoSettings) -> dict[str, str]:
    """Version of OpenColorIO and hash of the view with its tables; empty for sRGB; errors as above."""
    if not settings.ocio:
        return {}
    processor, _ = _open_ocio(settings)
    import PyOpenColorIO

    return {"opencolorio": str(PyOpenColorIO.GetVersion()), "processor": str(processor.getCacheID())}


def files_of_view(settings: VideoSettings) -> list[Path]:
    """The configuration of OpenColorIO, and the tables of the view; errors as above."""
    processor, _ = _open_ocio(settings)
    return [Path(settings.ocio), *map(Path, processor.getProcessorMetadata().getFiles())]


def _open_ocio(settings: VideoSettings) -> tuple[Any, int]:
    """OpenColorIO's processor for a view, and the transfer of its display."""
    file = settings.ocio
    try:
        import PyOpenColorIO
    except ImportError as error:
        raise SettingsError(
            "[video] ocio needs OpenColorIO, which is not installed: pip install opencolorio"
        ) from error
    try:
        config = PyOpenColorIO.Config.CreateFromFile(file)
        display, transfer = _display(config, settings)
        views, view = list(config.getViews(display)), settings.view or config.getDefaultView(display)
        if view not in views:
            raise SettingsError(f"{file} has no view {view!r} of {display!r}; it has: {', '.join(views)}")
        looks = [look.getName() for look in config.getLooks()]
        if settings.look and settings.look not in looks:
            raise SettingsError(f"{file} has no look {settings.look!r}; it has: {', '.join(looks) or 'none'}")
        pipeline = PyOpenColorIO.LegacyViewingPipeline()
        pipeline.setDisplayViewTransform(
            PyOpenColorIO.DisplayViewTransform(src=_linear_rec709(config, file), display=display, view=view)
        )
        pipeline.setLooksOverrideEnabled(bool(settings.look))
        pipeline.setLooksOverride(settings.look)
        processor = pipeline.getProcessor(config)
    except (PyOpenColorIO.Exception, PyOpenColorIO.ExceptionMissingFile) as error:
        raise SettingsError(f"OpenColorIO can't use {file}: {error}") from error
    return processor, transfer


def _display(config: Any, settings: VideoSettings) -> tuple[str, int]:
    """Name and transfer of the display."""
    names = list(config.getDisplays())
    for start, transfer in DISPLAYS:
        for name in names:
            if name.lower().startswith(start) and settings.display in ("", name):
                return name, transfer
    named = f" {settings.display!r}" if settings.display else ""
    raise SettingsError(
        f"{settings.ocio} has no display{named} for sRGB or Rec.709; it has: {', '.join(names)}"
    )


def _linear_rec709(config: Any, file: str) -> str:
    for name in LINEAR_REC709:
        if (space := config.getColorSpace(name)) is not None:
            return str(space.getName())
    raise SettingsError(f"{file} has no colour space for linear Rec.709, such as {LINEAR_REC709[0]!r}")
