"""Renders camera walkthroughs of static scenes; light is reused from frame to frame.

>>> import enfilade
>>> enfilade.render("scene.xml", "camera_path.json", "runs/walk", method="decoupled")  # doctest: +SKIP

Nothing heavy is imported before it is used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from enfilade.api import compare, import_scene, plan, render, report
    from enfilade.camera import Camera, CameraPath, load_path
    from enfilade.methods.base import Method
    from enfilade.scene.opener import Scene
    from enfilade.settings import Section, Settings, option

_PLACES = {
    "render": "enfilade.api",
    "plan": "enfilade.api",
    "import_scene": "enfilade.api",
    "compare": "enfilade.api",
    "report": "enfilade.api",
    "Camera": "enfilade.camera",
    "CameraPath": "enfilade.camera",
    "load_path": "enfilade.camera",
    "Method": "enfilade.methods.base",
    "Scene": "enfilade.scene.opener",
    "Section": "enfilade.settings",
    "Settings": "enfilade.settings",
    "option": "enfilade.settings",
}

__all__ = [
    "Camera",
    "CameraPath",
    "Method",
    "Scene",
    "Section",
    "Settings",
    "compare",
    "import_scene",
    "load_path",
    "option",
    "plan",
    "render",
    "report",
]


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module 'enfilade' has no attribute {name!r}")
    return getattr(importlib.import_module(_PLACES[name]), name)
