"""The public functions: render, plan, import_scene, compare, report."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enfilade.device import Choice, activate
from enfilade.monitor import SILENCE, Monitor

if TYPE_CHECKING:
    from enfilade.camera import CameraPath
    from enfilade.comparison import SequenceDifference
    from enfilade.methods.base import Method
    from enfilade.runs.plan import Plan
    from enfilade.scene.blender.imported import ImportedScene
    from enfilade.scene.opener import Scene
    from enfilade.settings import Settings

    File = str | Path
    Tables = Mapping[str, Mapping[str, Any]]


def render(
    scene: File | Scene,
    path: File | CameraPath | None,
    out: File,
    *,
    method: str | type[Method] = "decoupled",
    settings: Settings | Tables | None = None,
    device: Choice = "auto",
    executor: str = "in-process",
    workers: int | None = None,
    monitor: Monitor = SILENCE,
) -> dict[str, Any]:
    """Render a walkthrough into a run folder, or go on with one.

    Parameters
    ----------
    scene
        A Mitsuba 3 scene in XML, a :class:`Scene`, a .blend, glTF, USD, FBX or OBJ file, which Blender
        imports into the run folder, or the folder of an imported scene.
    path
        A camera path file (see docs/formats.md), or a :class:`CameraPath`; None: that of the imported scene.
    out
        The run folder. With the same arguments the call continues where it stopped.
    method
        ``decoupled``, ``paper``, ``reference``, or a method of your own, whose class worker processes can
        import.
    settings
        A :class:`Settings`, or tables such as ``{"decoupled": {"quality": 5.0}}``. Exposure and view of an
        imported file stand below tables; a :class:`Settings` replaces them.
    device
        ``cpu``, ``gpu``, or ``auto``: the GPU where there is one. A process has one device, that of its first
        call; ``auto`` stays there.
    executor
        ``in-process``, ``processes``, ``ray`` or ``ray:ADDRESS``. The processes import your main module:
        guard its work by ``if __name__ == "__main__"``.
    workers
        Number of worker processes; None: one for each GPU, or CPU core.
    monitor
        Receives progress and messages; by default nothing is shown.

    Returns
    -------
    dict
        The summary of the run, as in ``summary.json``: see :func:`enfilade.runs.statistics.statistics`.

    Raises
    ------
    InputError
        The scene, the path, a setting, or a folder that holds another run.
    DeviceError
        No usable LLVM or CUDA, or the process has another device.
    NoSpaceError
        The disk is full. All finished tasks stay.
    UnfinishedError
        Some tasks failed again and again; the rest is done.
    """
    activate(device)
    from enfilade.methods.opener import name_of
    from enfilade.runs.executor import Workers
    from enfilade.runs.render import render as render_job
    from enfilade.runs.source import job_of

    job = job_of(scene, path, settings or {}, name_of(method), Path(out), monitor)
    return render_job(job, Path(out), monitor, Workers(executor, workers))


def plan(
    scene: File | Scene,
    path: File | CameraPath | None,
    *,
    method: str | type[Method] = "decoupled",
    settings: Settings | Tables | None = None,
    device: Choice = "auto",
    monitor: Monitor = SILENCE,
) -> Plan:
    """Analyze every frame of a path, place the initial keyframes, and forecast the cost of rendering.

    The parameters are those of :func:`render`.

    Returns
    -------
    Plan

    Raises
    ------
    InputError, DeviceError
        As of :func:`render`.
    """
    activate(device)
    from enfilade.files import scratch_folder
    from enfilade.methods.opener import name_of
    from enfilade.runs.plan import plan as plan_job
    from enfilade.runs.source import job_of

    with scratch_folder("enfilade-plan") as run:
        job = job_of(scene, path, settings or {}, name_of(method), run, monitor)
        return plan_job(job, monitor)


def import_scene(
    source: File,
    out: File,
    *,
    settings: Tables | None = None,
    size: tuple[int, int] | None = None,
    frames: tuple[int, int] | None = None,
    monitor: Monitor = SILENCE,
) -> ImportedScene:
    """Import a file by Blender, in a process of its own, as a scene folder for :func:`render`.

    Parameters
    ----------
    source
        A .blend, glTF, USD, FBX or OBJ file. Scripts in it are not run.
    out
        The scene folder. An imported scene is replaced, a folder with anything else is refused.
    settings
        Tables of the sections ``blender`` and ``limits``, such as ``{"blender": {"camera": "Walk"}}``.
    size
        Width and height of the images, pixels; None: the file's own.
    frames
        First and last; None: the file's own.
    monitor

    Returns
    -------
    ImportedScene
        Its folder, and what was baked, approximated and not carried over.

    Raises
    ------
    SceneError
        There is no Blender; the file is missing, damaged or too large; part of it is not carried over, and
        ``[blender] strict`` is set; or the folder holds something else.
    CameraPathError
        The size of the images is none.
    RunFolderError, NoSpaceError
        The folder can't be written.
    """
    from enfilade.runs.source import choices_of
    from enfilade.scene.blender.importer import import_file
    from enfilade.settings import BlenderSettings, LimitSettings, Settings

    chosen = Settings.from_tables(settings or {}, (BlenderSettings, LimitSettings))
    blender = chosen[BlenderSettings]
    return import_file(
        Path(source),
        Path(out),
        choices_of(blender, size, frames),
        chosen[LimitSettings],
        monitor,
        program=blender.program,
        is_strict=blender.strict,
    )


def compare(
    test: File,
    reference: File,
    *,
    second_reference: File | None = None,
    monitor: Monitor = SILENCE,
    **options: Any,
) -> SequenceDifference:
    """Measure the visible difference between two image sequences, videos or run folders.

    Parameters
    ----------
    test, reference
        Run folders, videos, folders of images, or patterns such as ``frames/%04d.exr``.
    second_reference
        The reference rendered with another seed: the test is compared with the mean of both, and the result
        has their noise (``noise_floor``).
    monitor
    options
        Fields of :class:`enfilade.comparison.CompareOptions`.

    Returns
    -------
    SequenceDifference

    Raises
    ------
    ImageError
        A sequence can't be read, or the two can't be compared.
    SettingsError
        There is no such mode, flow or measure.
    """
    from enfilade.comparison import CompareOptions
    from enfilade.comparison import compare as compare_sequences

    chosen = CompareOptions(**options)
    return compare_sequences(test, reference, chosen, monitor, second_reference=second_reference)


def report(
    run: File,
    *,
    reference: File | None = None,
    second_reference: File | None = None,
    out: File | None = None,
) -> Path:
    """Write a finished or running run as one HTML page.

    Parameters
    ----------
    run
        The run folder.
    reference
        Another run, or a sequence, of the same frames: adds the visible difference.
    second_reference
        As of :func:`compare`.
    out
        The page; by default ``report.html`` in the run folder.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    RunFolderError, ImageError, SettingsError
    """
    activate("auto")  # "cpu" would hide the GPUs from later calls of this process
    from enfilade.reports.page import write_report

    return write_report(Path(run), reference=reference, second_reference=second_reference, out=out)
