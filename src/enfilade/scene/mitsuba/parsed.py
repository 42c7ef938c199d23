"""What Mitsuba's own parser makes of a scene, before anything of it is built."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import mitsuba as mi

from enfilade.device import active
from enfilade.errors import SceneError
from enfilade.scene.scenefile import Demands

__all__ = ["parsed_demands"]

WHERE = re.compile(r"\[\w+\.(?:cpp|h):\d+\] ")  # places in Mitsuba's code


def parsed_demands(file: Path) -> Demands:
    """Let Mitsuba parse a scene, as it does when it loads one; no plugin is loaded.

    Files with spectra are read.

    Raises
    ------
    SceneError
        Mitsuba refuses it.
    """
    mi.set_variant(active().variant)
    mi.set_log_level(mi.LogLevel.Error)
    untyped: Any = mi  # its stubs don't know these functions
    known = untyped.file_resolver()
    beside = mi.FileResolver(known)
    beside.prepend(str(file.parent))
    untyped.set_file_resolver(beside)
    try:
        state = mi.parser.parse_file(mi.parser.ParserConfig(active().variant), str(file))
    except RuntimeError as error:
        reason = WHERE.sub("", str(error).strip().splitlines()[-1])
        raise SceneError(f"Mitsuba can't load {file}: {reason}") from error
    finally:
        untyped.set_file_resolver(known)
    every = [node.props for node in state.nodes]
    return Demands(
        files=frozenset(Path(str(read)).resolve() for read in state.files),
        plugins=frozenset(props.plugin_name() for props in every),
        strings=frozenset(
            (key, props[key])
            for props in every
            for key in props.keys()  # noqa: SIM118  (no dictionary)
            if props.type(key) == mi.Properties.Type.String
        ),
    )
