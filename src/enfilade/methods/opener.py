"""Opening methods by name."""

from __future__ import annotations

import importlib

from enfilade.errors import SettingsError
from enfilade.methods.base import Method
from enfilade.settings import SECTIONS, Section

METHODS = {
    "decoupled": "enfilade.methods.decoupled.method:Decoupled",
    "paper": "enfilade.methods.paper.method:Paper",
    "reference": "enfilade.methods.reference:Reference",
}


def open_method(name: str) -> Method:
    """A new instance of a method.

    Parameters
    ----------
    name
        One of :data:`METHODS`, or ``module:Class``.

    Raises
    ------
    SettingsError
        There is no such method.
    """
    module, _, attribute = METHODS.get(name, name).partition(":")
    if not attribute or not all(module.split(".")):
        raise SettingsError(
            f"there is no method {name!r}; choose one of {', '.join(METHODS)}, or give module:Class"
        )
    try:
        kind = getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError) as error:
        raise SettingsError(f"the method {name!r} can't be imported: {error}") from error
    if not (isinstance(kind, type) and issubclass(kind, Method)):
        raise SettingsError(f"{name!r} is not a method: it must be a subclass of enfilade.Method")
    return kind()


def sections_of(method: Method) -> tuple[type[Section], ...]:
    """Sections that settings of runs with a method may have: the built-in ones, and those of the method."""
    return tuple(dict.fromkeys([*SECTIONS, *method.settings]))


def name_of(kind: str | type[Method]) -> str:
    """The name by which :func:`open_method` finds a method in any process.

    Raises
    ------
    SettingsError
        It is no class, or not at the top level of an importable module.
    """
    if isinstance(kind, str):
        return kind
    if not isinstance(kind, type):
        raise SettingsError(
            f"{kind!r} is no class: give the class of a method; its settings go into tables of their own"
        )
    if kind.__module__ == "__main__" or "." in kind.__qualname__:
        raise SettingsError(
            f"the method {kind.__qualname__} must be a class at the top level of a module that worker "
            "processes can import"
        )
    name = f"{kind.__module__}:{kind.__qualname__}"
    return next((short for short, full in METHODS.items() if full == name), name)
