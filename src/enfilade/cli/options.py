"""Options that several commands share: scene and camera path, settings, workers, output."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import Field, fields
from enum import Enum
from pathlib import Path
from typing import Any, TypeVar

import click

from enfilade.device import Choice, activate
from enfilade.errors import SettingsError
from enfilade.settings import (
    BlenderSettings,
    DecoupledSettings,
    LimitSettings,
    OutputSettings,
    SamplingSettings,
    Section,
    Settings,
    TraceSettings,
    VideoSettings,
    ViewingSettings,
    read_tables,
)

Command = TypeVar("Command", bound=Callable[..., Any])

FLAGS: dict[str, tuple[type[Section], str]] = {  # flags of single settings
    "--spp": (SamplingSettings, "spp"),
    "--seed": (TraceSettings, "seed"),
    "--max-depth": (TraceSettings, "max_depth"),
    "--quality": (DecoupledSettings, "quality"),
    "--denoiser": (DecoupledSettings, "denoiser"),
    "--exposure-ev": (ViewingSettings, "exposure_ev"),
    "--codec": (VideoSettings, "codec"),
    "--video-quality": (VideoSettings, "quality"),
    "--ocio": (VideoSettings, "ocio"),
    "--view": (VideoSettings, "view"),
    "--display": (VideoSettings, "display"),
    "--layers": (OutputSettings, "layers"),
    "--allow": (LimitSettings, "allow"),
}
IMPORT_FLAGS: dict[str, tuple[type[Section], str]] = {
    "--scene": (BlenderSettings, "scene"),
    "--view-layer": (BlenderSettings, "view_layer"),
    "--camera": (BlenderSettings, "camera"),
    "--blender": (BlenderSettings, "program"),
    "--strict": (BlenderSettings, "strict"),
}
ALL_FLAGS = FLAGS | IMPORT_FLAGS
VIDEO_FLAGS = ("--exposure-ev", "--codec", "--video-quality", "--ocio", "--view", "--display")
COMMON = (ViewingSettings, VideoSettings, OutputSettings, LimitSettings)  # read by every run

_META = "enfilade.settings"


class Size(click.ParamType[tuple[int, int]]):
    """Width and height in pixels, written ``640x480``."""

    name = "WxH"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        """Read the two numbers."""
        if isinstance(value, tuple):
            return value
        match = re.fullmatch(r"([0-9]{1,9})[xX×]([0-9]{1,9})", str(value).strip())
        if match is None:
            self.fail(f"{value!r} is no size; write it like 640x480", param, ctx)
        return int(match[1]), int(match[2])


def decorated(*decorators: Callable[[Command], Command]) -> Callable[[Command], Command]:
    """Several decorators as one; options are listed in this order."""

    def decorate(command: Command) -> Command:
        for one in reversed(decorators):
            command = one(command)
        return command

    return decorate


_file = click.Path(path_type=Path)


def _path_options(*, is_required: bool) -> Callable[[Command], Command]:
    """Scene and camera path; a file that Blender imports has a path of its own."""
    own = "" if is_required else "  [default: that of an imported scene]"
    return decorated(
        click.argument("scene", type=_file),
        click.option(
            "--path",
            "path_file",
            type=_file,
            required=is_required,
            help=f"The camera path: nerfstudio's camera_path.json, or keyed poses.{own}",
        ),
        click.option(
            "--size", type=Size(), help="Width and height of the images, pixels.  [default: the path's]"
        ),
        click.option(
            "--frames",
            metavar="RANGES",
            help="Frames, both ends included: 1-250, 1,5,9 or 1-250:2.  [default: all]",
        ),
        click.option("--fps", type=float, help="Frames per second of the video.  [default: the path's]"),
    )


path_options = _path_options(is_required=True)
job_options = decorated(
    _path_options(is_required=False),
    click.option(
        "--method",
        default="decoupled",
        show_default=True,
        help="Method: decoupled, paper, reference, or your own as module:Class.",
    ),
)
device_option = click.option(
    "--device",
    type=click.Choice(("auto", "cpu", "gpu")),
    default="auto",
    show_default=True,
    help="Render on the CPU, on an NVIDIA GPU, or on the GPU where there is one.",
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
quiet_option = click.option("--quiet", is_flag=True, help="Show messages alone, no progress.")
output_options = decorated(device_option, json_option, quiet_option)
worker_options = decorated(
    click.option(
        "--executor",
        metavar="NAME",
        default="in-process",
        show_default=True,
        help="in-process, processes (on this machine), ray (a local cluster) or ray:ADDRESS.",
    ),
    click.option(
        "--workers",
        type=click.IntRange(1),
        help="Number of worker processes.  [default: one for each GPU, or CPU core]",
    ),
    click.option(
        "--threads",
        type=click.IntRange(0),
        default=0,
        show_default=True,
        help="Threads of each worker; 0: its share of the cores.",
    ),
)


def settings_options(*flags: str, default: str = "") -> Callable[[Command], Command]:
    """Flags of single settings, ``--settings`` and ``--set``.

    Parameters
    ----------
    flags
        Of :data:`ALL_FLAGS`.
    default
        Shown in help in place of the settings' own defaults.
    """
    file = click.option(
        "--settings",
        "settings_file",
        type=click.Path(path_type=Path),
        help="A TOML file with a table for each section of settings; flags win over it.",
        expose_value=False,
        callback=lambda ctx, _, value: _keep(ctx, "file", value),
    )
    single = click.option(
        "--set",
        "assignments",
        metavar="SECTION.NAME=VALUE",
        multiple=True,
        help="Any setting of docs/formats.md; as often as wanted.",
        expose_value=False,
        callback=lambda ctx, _, value: _keep(ctx, "set", value),
    )
    return decorated(*(_setting_option(flag, default) for flag in flags), file, single)


def _setting_option(flag: str, default: str) -> Callable[[Command], Command]:
    kind, name = ALL_FLAGS[flag]
    field = next(f for f in fields(kind) if f.name == name)
    # `is_flag=False` would make click take a value such as -1 for an option
    terms = {"is_flag": True} if isinstance(field.default, bool) else {"type": _type_of(field)}
    return click.option(
        flag,
        f"{kind.table}__{name}",
        **terms,
        help=f"{field.metadata['help']}  [default: {default or _shown(field.default)}]",
        expose_value=False,
        callback=lambda ctx, _, value: _keep(ctx, flag, value),
    )


def _keep(ctx: click.Context, key: str, value: Any) -> None:
    if value is not None and value is not False and value != ():
        ctx.meta.setdefault(_META, {})[key] = value


def _type_of(field: Field[Any]) -> click.ParamType[Any] | type:
    choices = field.metadata["choices"]
    return click.Choice(choices) if choices else type(field.default)


def _shown(default: Any) -> str:
    value = default.value if isinstance(default, Enum) else default
    return "none" if value == "" else str(value)


def tables_of(ctx: click.Context, kinds: Iterable[type[Section]]) -> dict[str, dict[str, Any]]:
    """Settings that the file, ``--set`` and the flags of this command give, unchecked, by table.

    Paths are made absolute: those of flags from the working folder, those of a file from its own.

    Raises
    ------
    SettingsError
        The file can't be read, or an assignment is malformed.
    """
    given = ctx.meta.get(_META, {})
    tables: dict[str, Any] = {}
    if "file" in given:
        tables = read_tables(given["file"])
        _make_absolute(tables, given["file"].parent, kinds)
    for text in given.get("set", ()):
        section, name, value = _assignment(text)
        tables.setdefault(section, {})[name] = value
    for flag, (kind, name) in ALL_FLAGS.items():
        if flag in given:
            tables.setdefault(kind.table, {})[name] = given[flag]
    _make_absolute(tables, Path(), kinds)
    return tables


def _assignment(text: str) -> tuple[str, str, Any]:
    match = re.fullmatch(r"\s*(\w+)\.(\w+)\s*=(.*)", text)
    if match is None:
        raise SettingsError(f"--set {text}: write it like --set masks.slow_deg_s=0.3")
    return match[1], match[2], value_of(match[3])


def value_of(text: str) -> Any:
    """A value as TOML has it, or a word without quotes."""
    import tomllib

    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):  # also of numbers of thousands of digits
        return text.strip()


def _make_absolute(tables: dict[str, Any], folder: Path, kinds: Iterable[type[Section]]) -> None:
    for kind in kinds:
        table = tables.get(kind.table, {})
        for field in fields(kind):
            if field.metadata["is_path"] and field.name in table:
                table[field.name] = _absolute(table[field.name], folder, field.metadata["joined_by"])


def _absolute(value: Any, folder: Path, joined_by: str) -> Any:
    if isinstance(value, list):
        return [_absolute(part, folder, "") for part in value]
    if not isinstance(value, str) or value == "" or "://" in value:
        return value
    parts = value.split(joined_by) if joined_by else [value]
    # Links stay: the `python` of a virtual environment is one.
    return joined_by.join(os.path.abspath(folder / part) if part else part for part in parts)  # noqa: PTH100


def settings_of(ctx: click.Context, kinds: Iterable[type[Section]]) -> Settings:
    """Settings of the defaults, the file, ``--set`` and the flags of this command.

    Raises
    ------
    SettingsError
        The file can't be read; a setting is unknown, of the wrong type, or out of range.
    """
    kinds = tuple(kinds)
    return Settings.from_tables(tables_of(ctx, kinds), kinds)


def given_in(ctx: click.Context, kind: type[Section]) -> set[str]:
    """Names of a section's settings that this command gives."""
    return set(tables_of(ctx, (kind,)).get(kind.table, {}))


def assigned(ctx: click.Context) -> dict[str, tuple[str, str]]:
    """Flags and assignments of this command, as typed, with the tables and names of their settings."""
    given = ctx.meta.get(_META, {})
    named = {flag: (kind.table, name) for flag, (kind, name) in ALL_FLAGS.items() if flag in given}
    return named | {f"--set {text}": _assignment(text)[:2] for text in given.get("set", ())}


def choose_device(device: Choice) -> None:
    """Activate a device; a note says why ``auto`` is not the GPU that is there.

    Raises
    ------
    DeviceError
        The device is not there.
    """
    if note := activate(device).note:
        click.echo(f"note    rendered on the CPU: {note}", err=True)


def check_effect(ctx: click.Context, what: str, read: Mapping[type[Section], Collection[str]]) -> None:
    """Refuse flags and assignments of settings that a command does not read; a file may have them.

    Parameters
    ----------
    ctx
    what
        It makes, for the message.
    read
        Names of settings by section; none: all of the section.

    Raises
    ------
    SettingsError
    """
    known = {kind.table: names for kind, names in read.items()}
    for flag, (table, name) in assigned(ctx).items():
        if table not in known:
            raise SettingsError(f"{flag} has no effect on {what}, which does not read [{table}]")
        if known[table] and name not in known[table]:
            raise SettingsError(f"{flag} has no effect on {what}, which does not read {name}")


def check_suffix(flag: str, file: Path | None, suffix: str) -> None:
    """Refuse a file whose name is that of another format: it may be one that is to stay.

    Raises
    ------
    SettingsError
    """
    if file is not None and file.suffix.lower() != suffix:
        raise SettingsError(f"{flag} {file}: give a file name that ends in {suffix}")
