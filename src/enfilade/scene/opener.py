"""A scene, and the renderer that reads it.

Mitsuba reads ``.xml`` scenes. A renderer of your own is named by an import path, ``module:function``. The
function is called with the scene's file, ``max_depth`` and ``paths_in_flight`` (paths traced at once), and
returns a :class:`enfilade.renderer.Renderer`. Worker processes must be able to import the module, too.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.metadata
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from enfilade.device import active
from enfilade.errors import SceneError, SettingsError
from enfilade.renderer import Renderer
from enfilade.resource_limits import is_out_of_memory
from enfilade.scene.blender.source import SUFFIXES
from enfilade.scene.preflight import Preflight, preflight
from enfilade.settings import LimitSettings, Settings, TraceSettings

ADVICE = {
    ".json": "a camera path is given by --path",
    **dict.fromkeys(SUFFIXES, "import it by `enfilade import`, and give the scene.xml that it writes"),
}


@dataclass(frozen=True)
class Scene:
    """A scene file.

    Attributes
    ----------
    file : Path
    renderer : str
        Import path of your own renderer; empty: Mitsuba.
    """

    file: Path
    renderer: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "file", Path(self.file))

    def check(self, limits: LimitSettings) -> None:
        """Refuse a scene that is missing, or uses plugins or files that it may not, without loading it.

        The scene of your own renderer must only exist.

        Raises
        ------
        SceneError
        SettingsError
            There is no such renderer.
        """
        if self.renderer:
            _imported(self.renderer)
            if not self.file.is_file():
                raise SceneError(f"there is no scene file {self.file}")
            return
        self._check_suffix()
        from enfilade.scene.mitsuba.files import check_scene

        check_scene(self.file, limits)

    def identity(self) -> dict[str, str]:
        """Renderer with its version, variant of its kernels, and fingerprint of the scene's files.

        Raises
        ------
        SceneError
            The scene is missing or malformed.
        """
        if self.renderer:
            try:
                digest = hashlib.sha256(self.file.read_bytes()).hexdigest()
            except OSError as error:
                raise SceneError(f"can't read the scene {self.file}: {error.strerror}") from error
            return {"renderer": self.renderer, "variant": active().backend, "fingerprint": digest}
        self._check_suffix()
        from enfilade.scene.mitsuba.files import fingerprint

        name = f"Mitsuba {importlib.metadata.version('mitsuba')}"
        return {"renderer": name, "variant": active().variant, "fingerprint": fingerprint(self.file)}

    def preflight(self, settings: Settings) -> Preflight:
        """Load the scene once in a process of its own, with limits of memory and time.

        Raises
        ------
        SceneError
        """
        if self.renderer:
            return Preflight()
        return preflight(self.file, settings[TraceSettings], settings[LimitSettings], active().variant)

    def open(self, settings: Settings) -> Renderer:
        """Load the scene.

        Raises
        ------
        SceneError
            It is missing, malformed, or refused by the renderer.
        SettingsError
            There is no such renderer.
        DeviceError
            No usable LLVM or CUDA.
        MemoryError
        """
        options = {
            "max_depth": settings[TraceSettings].max_depth,
            "paths_in_flight": settings[LimitSettings].paths_in_flight,
        }
        if self.renderer:
            opened: Renderer = _imported(self.renderer)(self.file, **options)
            return opened
        self._check_suffix()
        from enfilade.scene.mitsuba.files import reason
        from enfilade.scene.mitsuba.renderer import MitsubaRenderer

        try:
            return MitsubaRenderer(self.file, **options)
        except RuntimeError as error:  # of Mitsuba, such as by a plugin that this variant lacks
            if is_out_of_memory(str(error)):
                raise MemoryError(f"too little memory to open {self.file}") from error
            raise SceneError(f"Mitsuba can't render {self.file}: {reason(error)}") from error

    def to_json(self) -> dict[str, Any]:
        """The scene, fit for JSON; read back by :meth:`from_json`."""
        return {"file": str(self.file.resolve()), "renderer": self.renderer}

    @staticmethod
    def from_json(table: dict[str, Any]) -> Scene:
        """Read back from :meth:`to_json`."""
        return Scene(Path(table["file"]), str(table["renderer"]))

    def _check_suffix(self) -> None:
        suffix = self.file.suffix.lower()
        if suffix != ".xml":
            advice = f": {ADVICE[suffix]}" if suffix in ADVICE else ""
            raise SceneError(f"{self.file} is not a scene in Mitsuba's XML format (.xml){advice}")


def _imported(renderer: str) -> Any:
    module, _, function = renderer.partition(":")
    try:
        return getattr(importlib.import_module(module), function)
    except (ImportError, AttributeError, ValueError) as error:
        raise SettingsError(
            f"there is no renderer {renderer!r}: {error}; give it as module:function, of an importable module"
        ) from error
