"""Fidelity of the corpus of files from Blender: ``python -m studies blender``."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import click
import numpy as np

from enfilade.records import F32
from studies.blender.measures import Fidelity, compare, displayed

ROOT = Path(__file__).resolve().parents[2]
EXPORTER, CORPUS = ROOT / "src" / "enfilade_blender", ROOT / "tests" / "blender" / "corpus"
SEEDS = 1, 2


@click.command("blender", short_help="Scenes from Blender, against Cycles.")
@click.option("--blender", default=str(ROOT / ".venv-blender" / "bin" / "python"), help="A Python with bpy.")
@click.option("--only", multiple=True, help="Name of a file; all by default.")
@click.option("--spp", default=128, help="Samples a pixel of each half.")
@click.option("--source", type=click.Path(path_type=Path, exists=True), help="A .blend file of your own.")
@click.option("--keep", is_flag=True, help="Take Cycles' images of an earlier run.")
@click.option("--out", type=click.Path(path_type=Path), default=Path("runs/blender"))
def command(
    blender: str, only: tuple[str, ...], spp: int, source: Path | None, out: Path, *, keep: bool
) -> None:
    """Render each file by Cycles and, exported, by Mitsuba; print differences, and write both pictures."""
    if source:
        files = [source]
    else:
        names = [*only] or _run(blender, [str(CORPUS), "--list"], out).split()
        if not keep:
            _run(blender, [str(CORPUS), str(out / "files"), *names], out)
        files = [out / "files" / f"{name}.blend" for name in names]
    click.echo(f"{'file':20} {'mean %':>7} {'1-SSIM':>7}  notes")
    for file in files:
        fidelity, notes = measure(file.resolve(), blender, spp, out.resolve(), keep=keep)
        click.echo(f"{file.stem:20} {fidelity.mean_percent:7.2f} {fidelity.structure:7.3f}  {notes}")


def measure(file: Path, blender: str, spp: int, out: Path, *, keep: bool) -> tuple[Fidelity, str]:
    """Fidelity of one file, and the kinds of its notes."""
    folder = out / file.stem
    _job(blender, {"task": "export", "source": str(file), "out": str(folder / "scene")}, folder)
    cycles = []
    for seed in SEEDS:
        images = folder / f"cycles-{seed}"
        if not keep or not list(images.glob("*.exr")):
            job = {
                "task": "cycles",
                "source": str(file),
                "out": str(images),
                "spp": spp,
                "seed": seed,
                "unbiased": True,
            }
            _job(blender, job, folder)
        cycles.append(read_exr(next(images.glob("*.exr"))))
    ours = [render(folder / "scene", spp, seed) for seed in SEEDS]
    result = compare((cycles[0], cycles[1]), (ours[0], ours[1]))
    _write_pictures(out / f"{file.stem}.png", 0.5 * (cycles[0] + cycles[1]), 0.5 * (ours[0] + ours[1]))
    notes = json.loads((folder / "scene" / "import.json").read_text(encoding="utf-8"))["notes"]
    kinds = [note["kind"] for note in notes]
    return result, ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))


def render(scene: Path, spp: int, seed: int) -> F32:
    """The first frame of an exported scene, by Mitsuba's own integrator through a box filter."""
    import mitsuba as mi

    if mi.variant() is None:
        mi.set_variant("llvm_ad_rgb")
    path = json.loads((scene / "camera_path.json").read_text(encoding="utf-8"))
    frame = path["camera_path"][0]
    loaded = mi.load_file(str(scene / "scene.xml"))
    shift = frame.get("principal_point", (0.5, 0.5))
    sensor = mi.load_dict(
        {
            "type": "perspective",
            "fov": frame["fov"],
            "fov_axis": "y",
            "near_clip": 0.001,
            "far_clip": 1e5,
            "principal_point_offset_x": 0.5 - shift[0],
            "principal_point_offset_y": 0.5 - shift[1],
            "to_world": mi.ScalarTransform4f(
                np.array(frame["camera_to_world"]) @ np.diag([-1.0, 1.0, -1.0, 1.0])
            ),
            "sampler": {"type": "multijitter"},
            "film": {
                "type": "hdrfilm",
                "width": path["render_width"],
                "height": path["render_height"],
                "rfilter": {"type": "box"},
            },
        }
    )
    return np.array(mi.render(loaded, sensor=sensor, spp=spp, seed=seed))[..., :3]


def read_exr(file: Path) -> F32:
    """Linear colours of an OpenEXR image."""
    import mitsuba as mi

    if mi.variant() is None:
        mi.set_variant("llvm_ad_rgb")
    return np.array(mi.Bitmap(str(file)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32))


def _job(blender: str, job: dict[str, object], folder: Path) -> None:
    file = folder / f"{job['task']}.job.json"
    folder.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(job), encoding="utf-8")
    _run(blender, [str(EXPORTER), str(file)], folder)


def _run(blender: str, arguments: list[str], folder: Path) -> str:
    folder.mkdir(parents=True, exist_ok=True)
    done = subprocess.run([blender, *arguments], capture_output=True, text=True, check=False)  # noqa: S603
    if done.returncode:
        error = next(iter(folder.rglob("error.json")), None)
        sys.exit(f"{' '.join(arguments)}: {error.read_text() if error else done.stderr[-2000:]}")
    return done.stdout


def _write_pictures(file: Path, cycles: F32, ours: F32) -> None:
    """Cycles, ours, and the displayed difference, times four about mid grey."""
    from PIL import Image

    a, b = displayed(cycles), displayed(ours)
    row = np.concatenate([a, b, np.clip(0.5 + 4.0 * (b - a), 0.0, 1.0)], axis=1)
    picture = Image.fromarray(np.rint(row * 255.0).astype(np.uint8))
    picture.resize((row.shape[1] * 3, row.shape[0] * 3), Image.Resampling.NEAREST).save(file)
