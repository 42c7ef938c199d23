"""Flags made from the settings: one for each field, with its help, default and range.

A flag beats the TOML file, the file beats the default. Paths are made absolute: workers elsewhere read them.
Those of flags count from the working folder, those in a file from the file's.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import Any, TypeVar

import click

from enfilade.settings import Section, Settings, read_tables, sections

Command = TypeVar("Command", bound=Callable[..., Any])

_META = "enfilade.settings"
SHORT = {
    ("trace", "spp"): "--spp",
    ("trace", "seed"): "--seed",
    ("light", "quality"): "--quality",
    ("limits", "allow"): "--allow",
    ("video", "codec"): "--codec",
    ("video", "ocio"): "--ocio",
    ("video", "view"): "--view",
    ("video", "display"): "--display",
    ("viewing", "exposure_ev"): "--exposure-ev",
}


class SettingOption(click.Option):
    """The flag of one setting; None unless it is given.

    Parameters
    ----------
    section
        Name of the section, as in a TOML file.
    field
        The setting.
    default
        What help says it is without the flag; empty: the setting's own default.
    """

    def __init__(self, section: str, field: dataclasses.Field[Any], default: str = "") -> None:
        self.section = section
        self.field = field
        super().__init__(
            [*_names(section, field), f"{section}__{field.name}"],
            type=_kind(field),
            help=f"{field.metadata['help']}  [{_limits(field, default)}]",
            default=None,
            expose_value=False,
            callback=_remember,
        )


class SettingsCommand(click.Command):
    """A command whose help lists the settings of each stage under a heading of their own."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the command's own options first, then those of each section."""
        groups: dict[str, list[tuple[str, str]]] = {"Options": []}
        options = (p for p in self.get_params(ctx) if isinstance(p, click.Option))
        for parameter in options:
            record = parameter.get_help_record(ctx)
            if record is not None:
                groups.setdefault(_heading(parameter), []).append(record)
        for heading, records in groups.items():
            with formatter.section(heading):
                formatter.write_dl(records, col_max=34)


def settings_options(*names: str, default: str = "") -> Callable[[Command], Command]:
    """Decorate a command with ``--settings`` and flags for settings: ``section`` or ``section.name``.

    Parameters
    ----------
    names
    default
        What help says they are without a flag; empty: their own defaults.
    """

    def decorate(command: Command) -> Command:
        options = [option for name in names for option in _options_of(name, default)]
        file = click.Option(
            ["--settings", "settings_file"],
            type=click.Path(path_type=Path),
            help="A TOML file with a table for each stage; flags win over it.",
            expose_value=False,
            callback=_remember_file,
        )
        for option in reversed([file, *options]):
            _attach(command, option)
        return command

    return decorate


def _options_of(name: str, default: str) -> list[SettingOption]:
    section, _, setting = name.partition(".")
    known = dataclasses.fields(sections()[section])
    return [SettingOption(section, field, default) for field in known if setting in ("", field.name)]


def settings_of(ctx: click.Context) -> Settings:
    """Settings from the defaults, the file and the flags of this command.

    Raises
    ------
    SettingsError
        The file can't be read; a setting is unknown, of the wrong type, or out of range.
    """
    return Settings.from_tables(tables_of(ctx))


def tables_of(ctx: click.Context) -> dict[str, Any]:
    """What the file and the flags of this command set, unchecked, by section.

    Raises
    ------
    SettingsError
        The file can't be read.
    """
    given = ctx.meta.get(_META, {})
    tables: dict[str, Any] = {}
    if "file" in given:
        tables = read_tables(given["file"])
        _root(tables, given["file"].parent)
    for (section, name), value in given.get("flags", {}).items():
        table = tables.setdefault(section, {})
        if isinstance(table, dict):  # what is no table, from_tables refuses with a reason
            table[name] = value
    _root(tables, Path())
    return tables


def _root(tables: dict[str, Any], folder: Path) -> None:
    """Make the paths in tables absolute, which count from a folder. What is no path stays for the checks."""
    for section, cls in sections().items():
        table = tables.get(section)
        for field in dataclasses.fields(cls):
            if field.metadata["is_path"] and isinstance(table, dict) and field.name in table:
                table[field.name] = _rooted(table[field.name], folder, field.metadata["joined_by"])


def _rooted(value: Any, folder: Path, joined_by: str) -> Any:
    if isinstance(value, list):
        return [_rooted(part, folder, "") for part in value]
    if not isinstance(value, str) or value == "" or "://" in value:
        return value
    parts = value.split(joined_by) if joined_by else [value]
    return joined_by.join(str((folder / part).resolve()) if part else part for part in parts)


def flags_given(ctx: click.Context) -> set[tuple[str, str]]:
    """Section and name of the settings that flags of this command set."""
    return set(ctx.meta.get(_META, {}).get("flags", {}))


def given_in(ctx: click.Context, section: str) -> set[str]:
    """Names of a section's settings that the file or a flag of this command sets.

    Raises
    ------
    SettingsError
        The file can't be read.
    """
    given = ctx.meta.get(_META, {})
    table = read_tables(given["file"]).get(section, {}) if "file" in given else {}
    flags = {name for of, name in flags_given(ctx) if of == section}
    return flags | set(table if isinstance(table, dict) else ())


def _attach(command: Any, option: click.Option) -> None:
    if isinstance(command, click.Command):
        command.params.append(option)
    else:
        command.__click_params__ = [*getattr(command, "__click_params__", []), option]


def _remember(ctx: click.Context, parameter: click.Parameter, value: Any) -> None:
    if value is not None and isinstance(parameter, SettingOption):
        flags = ctx.meta.setdefault(_META, {}).setdefault("flags", {})
        flags[parameter.section, parameter.field.name] = value


def _remember_file(ctx: click.Context, _parameter: click.Parameter, value: Path | None) -> None:
    if value is not None:
        ctx.meta.setdefault(_META, {})["file"] = value


def _names(section: str, field: dataclasses.Field[Any]) -> list[str]:
    name = f"--{section}-{field.name}".replace("_", "-")
    if isinstance(field.default, bool):
        return [f"{name}/--{section}-no-{field.name}".replace("_", "-")]
    short = SHORT.get((section, field.name))
    return [short, name] if short else [name]


def _kind(field: dataclasses.Field[Any]) -> click.ParamType[Any] | type:
    if isinstance(field.default, Enum):
        return click.Choice([choice.value for choice in type(field.default)])
    choices = field.metadata["choices"]
    return click.Choice(choices) if choices else type(field.default)


def _limits(field: dataclasses.Field[Any], shown_default: str) -> str:
    default = field.default
    shown: object = default.value if isinstance(default, Enum) else default
    if isinstance(default, bool):
        shown = "yes" if default else "no"
    text = f"default: {shown_default or ('none' if shown == '' else shown)}"
    least, most = field.metadata["least"], field.metadata["most"]
    if least is not None and most is not None:
        return f"{text}; {least:.10g} to {most:.10g}"
    return text if least is None else f"{text}; at least {least:.10g}"


def _heading(parameter: click.Parameter) -> str:
    if not isinstance(parameter, SettingOption):
        return "Options"
    section: type[Section] = sections()[parameter.section]
    title = (section.__doc__ or parameter.section).splitlines()[0].partition(":")[0].rstrip(".")
    return f"{title} [{parameter.section}]"
