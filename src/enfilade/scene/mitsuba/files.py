"""Plugins and files of a Mitsuba scene, as Mitsuba's own parser lists them.

Mitsuba loads a plugin of any name, from the scene's folder if it has a folder `plugins`, and opens files at
any path. A scene from elsewhere is therefore parsed and checked before it is loaded. Parsing instantiates no
plugin and needs no variant. It does read included XML files, and the files of ``<spectrum filename="...">``,
wherever they are: the former are checked afterwards, the latter hold numbers only, and are not checked.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import mitsuba as mi

from enfilade.errors import SceneError
from enfilade.settings import LimitSettings

PARSER_VARIANT = "scalar_rgb"  # required by the parser, which is the same for all variants
PLUGINS = Path(mi.__file__).resolve().parent / "plugins"
REPLACEMENTS = {  # of plugins that need a spectral variant of Mitsuba, or end the process: what to write
    "blackbody": "<rgb> with the colour of that temperature",
    "timed_sunsky": '<emitter type="sunsky">',
}
BLENDER = "blender"  # its meshes are addresses in the memory of a process
SOURCE_LOCATION = re.compile(r"\[\w+\.(?:cpp|h):\d+\] ")
OWN = "enfilade: "  # begins messages of ours that go through Mitsuba's log, which adds a function's name
NUMBERS = ("Float", "Vector", "Color", "Transform")  # types of properties
NOT_FINITE = re.compile(r"\b(?:nan|inf)\b")
UNDEFINED = re.compile(r"undefined parameter: \$(\w+)")
QUOTED_SPECTRUM = re.compile(r'(failed to load spectrum from file ".*?"): .*', re.DOTALL)


def check_scene(scene: Path, limits: LimitSettings) -> None:
    """Refuse a scene with plugins other than Mitsuba's own, files outside the allowed folders, or NaN.

    Allowed folders are the scene's own and those of ``limits.allow``.

    Raises
    ------
    SceneError
        The scene is malformed, a file is missing, or one of the above. The message names the file.
    """
    _check_there(scene)
    roots = [scene.resolve().parent, *(Path(p).resolve() for p in limits.allow.split(os.pathsep) if p)]
    with _parsed(scene) as (state, resolver):
        for node in state.nodes:
            name = node.props.plugin_name()
            if name != "scene" and not _is_own_plugin(name, resolver):
                where = mi.parser.file_location(state, node)
                raise SceneError(f"{where}: {name!r} is not one of Mitsuba's plugins for scene files")
            if name in REPLACEMENTS:
                where = mi.parser.file_location(state, node)
                raise SceneError(
                    f"{where}: {name} can't be rendered here; write {REPLACEMENTS[name]} in its place"
                )
            _check_numbers(state, node)
            if name == "instance":
                _check_instance(state, node)
        for file in _files(state, resolver):
            if not file.is_file():
                raise SceneError(f"{scene} uses {file}, which is missing or not a regular file")
            if not any(file.is_relative_to(root) for root in roots):
                raise SceneError(
                    f"{scene} uses {file}, outside the scene's folder; allow it with --allow {file.parent}"
                )


def fingerprint(scene: Path) -> str:
    """SHA-256 over the contents of the XML files of a scene, of the files they name, and of their spectra.

    Raises
    ------
    SceneError
        The scene is malformed, or a file is missing or can't be read.
    """
    digest = hashlib.sha256()
    with _parsed(scene) as (state, resolver):
        for file in dict.fromkeys(_files(state, resolver)):
            with file.open("rb") as stream:
                digest.update(hashlib.file_digest(stream, "sha256").digest())
        for _, spectrum in _properties(state, "Spectrum"):
            digest.update(repr((list(spectrum.wavelengths), list(spectrum.values))).encode())
    return digest.hexdigest()


def reason(error: Exception) -> str:
    """The last sentence of a Mitsuba error and the list below it, without locations in Mitsuba's source.

    The first line of a file that is no spectrum is left out: any file can be named as one.
    """
    text = QUOTED_SPECTRUM.sub(r"\1", SOURCE_LOCATION.sub("", str(error).strip()))
    lines = [line.strip() for line in text.splitlines()] or [""]
    first = max((i for i, line in enumerate(lines) if not line.startswith("- ")), default=0)
    listed = ", ".join(line.removeprefix("- ") for line in lines[first + 1 :])
    return f"{lines[first]} {listed}".strip()


@contextmanager
def collected_warnings() -> Iterator[list[str]]:
    """Collect Mitsuba's warnings, each once, in place of printing them."""
    untyped: Any = mi
    logger = untyped.logger()
    found: list[str] = []
    level, formatter = logger.log_level(), logger.formatter()
    appenders = [logger.appender(i) for i in range(logger.appender_count())]

    class Message(mi.Formatter):
        def format(self, level: Any, cname: str | None, fname: str, line: int, msg: str) -> str:
            del level, fname, line
            text = " ".join(msg.split())
            _, is_own, own = text.partition(OWN)
            if is_own:
                return own
            plugin = re.split(r"Impl|\[", cname or "")[0]
            return f"Mitsuba warns{'' if plugin in text else f' ({plugin})'}: {text}"

    class Collector(mi.Appender):
        def append(self, level: Any, text: str) -> None:
            if level == mi.LogLevel.Warn and text not in found:
                found.append(text)

        def log_progress(self, *_: Any) -> None:
            pass

    logger.clear_appenders()
    logger.add_appender(Collector())
    logger.set_formatter(Message())
    logger.set_log_level(mi.LogLevel.Warn)
    try:
        yield found
    finally:
        logger.clear_appenders()
        for appender in appenders:
            logger.add_appender(appender)
        logger.set_formatter(formatter)
        logger.set_log_level(level)


@contextmanager
def files_beside(scene: Path) -> Iterator[Any]:
    """Look for files in the folder of a scene first, links followed; the file resolver."""
    untyped: Any = mi  # its stubs lack the functions of the file resolver
    before = untyped.file_resolver()
    resolver = mi.FileResolver(before)
    resolver.prepend(str(scene.resolve().parent))
    untyped.set_file_resolver(resolver)
    try:
        yield resolver
    finally:
        untyped.set_file_resolver(before)


@contextmanager
def _parsed(scene: Path) -> Iterator[tuple[Any, Any]]:
    """The parsed scene, and the file resolver with all folders in which its files are looked for."""
    _check_there(scene)
    try:
        with files_beside(scene) as resolver:
            with collected_warnings():  # they come again when the scene is loaded
                state = mi.parser.parse_file(mi.parser.ParserConfig(PARSER_VARIANT), str(scene.resolve()))
            yield state, resolver
    except RuntimeError as error:
        undefined = UNDEFINED.search(str(error))
        hint = f'; add <default name="{undefined[1]}" value="..."/> to it' if undefined else ""
        raise SceneError(f"Mitsuba can't parse {scene}: {reason(error)}{hint}") from error
    except UnicodeDecodeError as error:
        raise SceneError(f"{scene} or a file that it includes is not UTF-8: {error}") from error
    except OSError as error:
        raise SceneError(f"can't read {error.filename}, which {scene} uses: {error.strerror}") from error


def _check_there(scene: Path) -> None:
    if not scene.is_file():  # nor a loop of links, which Path.resolve does not survive
        raise SceneError(f"there is no scene file {scene}")
    path = os.fsencode(scene.resolve())
    try:
        path.decode("utf-8")
    except UnicodeDecodeError as error:
        name = path.decode("utf-8", "backslashreplace")
        raise SceneError(
            f"the path {name} is not UTF-8, and Mitsuba can't read it: rename its file or folders"
        ) from error


def _is_own_plugin(name: str, resolver: Any) -> bool:
    library = Path(str(resolver.resolve(f"plugins/{name}.so")))
    return name != BLENDER and library.is_file() and library.resolve().parent == PLUGINS


def _check_numbers(state: Any, node: Any) -> None:
    """Refuse NaN and infinite numbers: Mitsuba renders such a shape black, or not at all.

    Meshes with such vertices are refused by Mitsuba itself.
    """
    properties = node.props
    for name in properties.keys():  # noqa: SIM118  (not a dictionary)
        kind = properties.type(name).name
        numbers = kind in NUMBERS and properties.as_string(name)
        if kind == "Spectrum":  # its string leaves the values out
            numbers = repr(list(properties[name].values))
        if numbers and NOT_FINITE.search(numbers):
            owner = f"{properties.plugin_name()} {properties.id()}".strip()
            raise SceneError(
                f"{mi.parser.file_location(state, node)}: {name!r} of {owner!r} has a number that is NaN or "
                "infinite; correct it in the scene file"
            )


def _check_instance(state: Any, node: Any) -> None:
    """Refuse an instance that holds its shape group: Mitsuba's error does not tell the cause."""
    properties = node.props  # of which a transform can't be read before a variant is chosen
    names = [name for name in properties.keys() if properties.type(name).name == "ResolvedReference"]  # noqa: SIM118
    nodes = [state.nodes[properties[name].index()] for name in names]
    if any(one.props.plugin_name() == "shapegroup" for one in nodes):
        raise SceneError(
            f"{mi.parser.file_location(state, node)}: an instance holds its shape group: move it to the top "
            'of the scene and refer to it by <ref id="..."/>'
        )


def _files(state: Any, resolver: Any) -> Iterator[Path]:
    """Absolute paths of the XML files of a scene, then of the files that they name, links followed."""
    xml = [Path(str(file)).resolve() for file in state.files]
    yield from xml
    for name, value in _properties(state, "String"):
        if name == "filename":
            yield (xml[0].parent / str(resolver.resolve(value))).resolve()


def _properties(state: Any, type_name: str) -> Iterator[tuple[str, Any]]:
    """Names and values of all properties of a type, in the order of the scene."""
    kind = getattr(mi.Properties.Type, type_name)
    for node in state.nodes:
        for name in node.props.keys():  # noqa: SIM118  (not a dictionary)
            if node.props.type(name) == kind:
                yield name, node.props[name]
