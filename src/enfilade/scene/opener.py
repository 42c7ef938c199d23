"""Opening of scenes, with the renderer that reads them.

Mitsuba reads ``.xml`` scenes. Your own renderer is named by an import path, ``module:function``. The function
is called with the scene's path and the trace settings, and returns a :class:`enfilade.renderer.Renderer`; the
format of the scene is up to it. Worker processes must be able to import the module as well (``PYTHONPATH``).
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.metadata
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from enfilade.device import active
from enfilade.errors import SceneError, SettingsError
from enfilade.renderer import Renderer
from enfilade.settings import LimitSettings, TraceSettings

__all__ = ["SceneIdentity", "check_scene", "identify_scene", "open_renderer"]

ADVICE = {
    ".blend": "export it with the mitsuba-blender add-on (File > Export > Mitsuba) and give the XML file: "
    "docs/camera-paths.md",
    ".json": "a camera path is given by --path",
}


@dataclass(frozen=True)
class SceneIdentity:
    """Facts that distinguish a scene and its renderer from others, known before the scene is loaded.

    Attributes
    ----------
    renderer : str
        Name and version of Mitsuba, or the import path of your own renderer, whose version is not known.
    variant : str
        Backend of its kernels.
    fingerprint : str
        SHA-256 over the scene's files; for your own renderer, over the scene file alone.
    """

    renderer: str
    variant: str
    fingerprint: str


def open_renderer(scene: Path, settings: TraceSettings, renderer: str | None = None) -> Renderer:
    """Load a scene.

    Parameters
    ----------
    scene
    settings
    renderer
        Import path of your own renderer; Mitsuba by default.

    Raises
    ------
    SceneError
        The scene is missing, malformed, or not one for Mitsuba.
    SettingsError
        There is no such renderer.
    DeviceError
        No usable LLVM or CUDA.
    """
    if renderer is not None:
        return _imported(renderer)(scene, settings)
    _check_suffix(scene)
    from enfilade.scene.mitsuba.renderer import MitsubaRenderer

    return MitsubaRenderer(scene, settings)


def check_scene(scene: Path, limits: LimitSettings, renderer: str | None = None) -> None:
    """Refuse a scene that can't be rendered, or uses what it may not, without loading it.

    The scene of your own renderer is only checked to be there.

    Raises
    ------
    SceneError, SettingsError
        As of :func:`open_renderer`, and :func:`enfilade.scene.mitsuba.files.check_scene`.
    """
    if renderer is not None:
        _imported(renderer)
        if not scene.is_file():
            raise SceneError(f"there is no scene file {scene}")
        return
    _check_suffix(scene)
    from enfilade.scene.mitsuba.files import check_scene as check_mitsuba_scene

    check_mitsuba_scene(scene, limits)


def identify_scene(scene: Path, renderer: str | None = None) -> SceneIdentity:
    """Identify a scene and its renderer without loading either.

    Raises
    ------
    SceneError
        The scene is missing or malformed.
    """
    if renderer is not None:
        try:
            return SceneIdentity(renderer, active().backend, hashlib.sha256(scene.read_bytes()).hexdigest())
        except OSError as error:
            raise SceneError(f"can't read the scene {scene}: {error.strerror}") from error
    _check_suffix(scene)
    from enfilade.scene.mitsuba.files import fingerprint

    version = importlib.metadata.version("mitsuba")
    return SceneIdentity(f"Mitsuba {version}", active().variant, fingerprint(scene))


def _check_suffix(scene: Path) -> None:
    suffix = scene.suffix.lower()
    if suffix != ".xml":
        advice = f": {ADVICE[suffix]}" if suffix in ADVICE else ""
        raise SceneError(f"{scene} is not a scene in Mitsuba's XML format (.xml){advice}")


def _imported(renderer: str) -> Callable[[Path, TraceSettings], Renderer]:
    module, _, function = renderer.partition(":")
    try:
        found: Callable[[Path, TraceSettings], Renderer] = getattr(importlib.import_module(module), function)
    except (ImportError, AttributeError, ValueError) as error:
        raise SettingsError(
            f"there is no renderer {renderer!r}: {error}; give it as module:function, of an importable module"
        ) from error
    return found
