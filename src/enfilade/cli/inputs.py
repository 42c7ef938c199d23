"""Arguments and flags that several commands share: scene, camera path, size, frames, output."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from enfilade.cli.flags import SHORT, flags_given, settings_of
from enfilade.device import Choice, activate, load
from enfilade.errors import SettingsError

if TYPE_CHECKING:
    from enfilade.pipeline.crew import Crew
    from enfilade.pipeline.job import Job

Command = TypeVar("Command", bound=Callable[..., Any])

METHODS = ("decoupled", "paper", "reference")
IDLE: dict[str, tuple[str, ...]] = {  # settings that say nothing to a method, by section or by name
    "decoupled": (
        "trace.spp", "trace.pixel_filter", "keyframes.spacing", "warp", "antialias", "metric.mask_slope",
        "masks.specular_jnd", "masks.specular_percent", "masks.split_percent",
    ),
    "paper": ("trace.pixel_filter", "light"),
    "reference": ("keyframes", "warp", "masks", "antialias", "light", "metric.mask_slope"),
}  # fmt: skip
INSTEAD = {  # ... and which do
    ("decoupled", "trace.spp"): "decoupled traces as many paths as --quality asks for",
    ("decoupled", "keyframes.spacing"): "its keyframes are --light-spacing frames apart",
    ("paper", "light.quality"): "paper traces --spp paths",
    ("reference", "light.quality"): "reference traces --spp paths",
}
JOB_SECTIONS = (
    "trace", "viewing", "keyframes", "warp", "metric", "masks", "antialias", "light", "video", "output",
    "limits",
)  # fmt: skip


class Size(click.ParamType[tuple[int, int]]):
    """Width and height in pixels, written ``640x480``."""

    name = "WxH"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        """Read the two numbers; the camera path says whether they fit."""
        if isinstance(value, tuple):
            return value
        match = re.fullmatch(r"([0-9]{1,9})[xX×]([0-9]{1,9})", str(value).strip())
        if match is None:
            self.fail(f"{value!r} is no size; write it like 640x480", param, ctx)
        return int(match[1]), int(match[2])


renderer_option = click.option(
    "--renderer",
    metavar="MODULE:FUNCTION",
    help="Your own renderer: a function that loads SCENE.  [default: Mitsuba]",
)


def job_options(command: Command) -> Command:
    """Decorate a command with the scene, the camera path, how to look at them, and the method."""
    method = click.option(
        "--method",
        type=click.Choice(METHODS),
        default=METHODS[0],
        show_default=True,
        help="Reuse the light of keyframes (decoupled), their colours (paper), or nothing (reference).",
    )
    return path_options(method(command))


def path_options(command: Command) -> Command:
    """Decorate a command with the scene, the camera path and how to look at them."""
    file = click.Path(path_type=Path)
    for decorate in reversed(
        [
            click.argument("scene", type=file),
            renderer_option,
            click.option(
                "--path",
                "path_file",
                type=file,
                required=True,
                help="The camera path: nerfstudio's camera_path.json or keyed poses.",
            ),
            click.option(
                "--size", type=Size(), help="Width and height of the images, pixels.  [default: the path's]"
            ),
            click.option(
                "--frames",
                metavar="RANGES",
                help="Frames to take, both ends included: 1-250, 1,5,9 or 1-250:2.  [default: all]",
            ),
            click.option("--fps", type=float, help="Frames per second of the video.  [default: the path's]"),
        ]
    ):
        command = decorate(command)
    return command


device_option = click.option(
    "--device",
    type=click.Choice(("auto", "cpu", "gpu")),
    default="auto",
    show_default=True,
    help="Run on the CPU, on an NVIDIA GPU, or on the GPU where there is one.",
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON, for programs.")
quiet_option = click.option("--quiet", is_flag=True, help="Show no progress.")


def crew_options(command: Command) -> Command:
    """Decorate a command with who does the work; it changes no result."""
    for decorate in (
        click.option(
            "--threads",
            type=click.IntRange(0),
            default=0,
            show_default=True,
            help="Threads of each worker, in process too; 0: its share of the cores.",
        ),
        click.option(
            "--workers",
            type=click.IntRange(1),
            help="Worker processes, or units on the cluster at once.  [default: one for each GPU, or core]",
        ),
        click.option(
            "--executor",
            metavar="WHO",
            default="in-process",
            show_default=True,
            help="Who does the work: in-process, processes (on this machine), ray (a local cluster) or "
            "ray:ADDRESS. Limits may follow: processes,idle=30,unit=90 ends a worker that uses no CPU time "
            "for 30 minutes (10 unless said), or takes more than 90 for a unit (none unless said).",
        ),
    ):
        command = decorate(command)
    return command


def crew_of(executor: str, workers: int | None, threads: int) -> Crew:
    """Who does the work. The device must be active; this process takes its threads now, if it is who.

    Raises
    ------
    SettingsError
        There is no such executor, or it has not as many workers.
    """
    from enfilade.executors.opener import check_executor

    check_executor(executor)
    if executor == "in-process" and (workers or 1) > 1:
        raise SettingsError(
            f"--workers {workers} says nothing to --executor in-process, which is one worker; add --executor "
            "processes, or leave it out"
        )
    if executor == "in-process" and threads:
        load().set_thread_count(threads)
    from enfilade.pipeline.crew import Crew

    return Crew(executor, workers, threads)


def output_options(command: Command) -> Command:
    """Decorate a command with where it runs and what it shows."""
    return device_option(json_option(quiet_option(command)))


def job_of(
    ctx: click.Context,
    *,
    scene: Path,
    path_file: Path,
    size: tuple[int, int] | None,
    frames: str | None,
    fps: float | None,
    method: str,
    renderer: str | None,
    device: Choice,
) -> Job:
    """Put together what to render; everything wrong in it raises here, before any work.

    Raises
    ------
    InputError
        A setting, the path or the selection of frames is wrong; a flag says nothing to the method.
    DeviceError
        The device is not there.
    """
    settings = settings_of(ctx)
    for section, name in sorted(flags_given(ctx)):
        if {section, setting := f"{section}.{name}"}.intersection(IDLE[method]):
            flag = SHORT.get((section, name), f"--{section}-{name}".replace("_", "-"))
            instead = f": {INSTEAD[method, setting]}" if (method, setting) in INSTEAD else ""
            raise SettingsError(
                f"{flag} says nothing to --method {method}{instead}; leave it out, or choose another method"
            )
    if note := activate(device).note:
        click.echo(f"note    rendered on the CPU: {note}", err=True)
    from enfilade.camera import load_path, parse_frames
    from enfilade.pipeline.job import Job

    selected = None if frames is None else parse_frames(frames)
    path = load_path(path_file, size=size, frames=selected, fps=fps)
    return Job(scene=scene, path=path, settings=settings, method=method, renderer=renderer)
