"""``python -m studies.bench.cycles shot.blend``: Cycles and Open Image Denoise against enfilade.

Both render one file. Each is measured against its own converged reference, since materials and lights are
not the same to the last percent. Cycles keeps its data from frame to frame. It has the file's own settings,
but for samples and denoiser, and without adaptive sampling, motion blur and compositing. CPU time is that of
whole processes: start, loading, all frames; a run of enfilade that compiled kernels is made again. Let
nothing else run at the same time.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np
from scipy.ndimage import uniform_filter

from enfilade.camera import parse_frames
from enfilade.cli.options import Size
from enfilade.cli.progress import watch
from enfilade.errors import EnfiladeError
from enfilade.files import read_json, write_json
from enfilade.images import read_exr
from enfilade.kernels.tone import srgb_encode
from enfilade.records import F32
from enfilade.scene.blender.find import find_blender
from enfilade.scene.blender.imported import PATH_FILE, SCENE_FILE
from enfilade.scene.blender.importer import import_file, job_table
from enfilade.scene.blender.process import CYCLES_FILE, cpu_of_children_s, run_job
from enfilade.scene.blender.source import Choices
from enfilade.settings import LimitSettings
from studies.bench.bench import cached_kernels
from studies.versions import machine, origin

SMOOTHED = 5  # pixels to a side
LIMITS = LimitSettings(import_s=86_400.0)
SEEDS = (1, 2)  # of the halves of a reference
COST = "cost.json"  # in the folder of a finished run


@dataclass(frozen=True)
class CyclesBench:
    """Runs of one file by both renderers, each in a folder of its own, kept when it is finished.

    Attributes
    ----------
    source, folder : Path
    size : tuple of int
        Width and height, pixels.
    frames, measured : tuple of int
        Frames that are rendered, and those that references have.
    program : str
        Blender; empty: the one that is found.
    """

    source: Path
    folder: Path
    size: tuple[int, int]
    frames: tuple[int, ...]
    measured: tuple[int, ...]
    program: str = ""

    def cycles(self, name: str, spp: int, *, seed: int = 0, is_reference: bool = False) -> Path:
        """Render by Cycles; a reference is not denoised."""
        out = self.folder / name
        frames = self.measured if is_reference else self.frames
        choices = Choices(size=self.size)
        job: dict[str, Any] = {
            **job_table("cycles", self.source, out, choices, LIMITS), "frame_list": list(frames), "spp": spp,
            "seed": seed, "denoise": not is_reference, "unbiased": False,
        }  # fmt: skip

        blender = find_blender(self.program)

        def work() -> None:
            with watch(quiet=False) as monitor:
                run_job(blender, job, LIMITS, monitor)

        return self._once(out, work)

    def enfilade(self, name: str, flags: Sequence[str], *, is_reference: bool = False) -> Path:
        """Render by enfilade, from the imported scene."""
        scene = self._scene()
        frames = ",".join(map(str, self.measured if is_reference else self.frames))
        out = self.folder / name
        files = [str(scene / SCENE_FILE), "--path", str(scene / PATH_FILE), "--out", str(out / "run")]
        line = [sys.executable, "-m", "enfilade", "render", *files, "--frames", frames, *flags]

        def work() -> None:
            if subprocess.run(line, check=False, stdout=subprocess.DEVNULL).returncode:
                raise EnfiladeError(f"{name} failed; the same command continues")

        return self._once(out, work, is_repeated=not is_reference)

    def row(self, name: str, run: Path, references: Sequence[Path]) -> dict[str, Any]:
        """Cost and quality of a run."""
        errors = [
            errors_of(_image(run, number), *(_image(of, number) for of in references))
            for number in self.measured
        ]
        displayed, relative = (float(np.mean(values)) for values in zip(*errors, strict=True))
        return {
            "name": name,
            "frames": len(self.frames),
            **read_json(run / COST),
            "psnr_db": -10.0 * float(np.log10(max(displayed, 1e-12))),
            "relative_rmse": float(np.sqrt(max(relative, 0.0))),
        }

    def _scene(self) -> Path:
        out = self.folder / "scene"
        if not out.exists():
            with watch(quiet=False) as monitor:
                import_file(self.source, out, Choices(size=self.size), LIMITS, monitor, program=self.program)
        return out

    def _once(self, out: Path, work: Callable[[], None], *, is_repeated: bool = False) -> Path:
        """Do work, and note its cost, unless its folder is finished; once more if it compiled kernels."""
        if (out / COST).is_file():
            return out
        kernels = cached_kernels()
        self._do(out, work)
        if is_repeated and cached_kernels() != kernels:  # they are in the cache on disk now
            self._do(out, work)
        return out

    def _do(self, out: Path, work: Callable[[], None]) -> None:
        """Do work in a new folder, and note its cost."""
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir(parents=True)
        began, cpu_began = time.monotonic(), cpu_of_children_s()
        work()
        cpu_s = cpu_of_children_s() - cpu_began
        write_json(out / COST, {"cpu_s": cpu_s, "wall_s": time.monotonic() - began})


def errors_of(image: F32, first: F32, second: F32) -> tuple[float, float]:
    """Mean square error of displayed values, and relative mean square error, without the references' noise.

    Parameters
    ----------
    image : (H, W, 3) float32
    first, second : (H, W, 3) float32
        Halves of the reference, with independent noise.
    """
    shown = [srgb_encode(np.clip(of, 0.0, 1.0)).astype(np.float64) for of in (image, first, second)]
    displayed = float(((shown[0] - shown[1]) * (shown[0] - shown[2])).mean())
    linear = [of.astype(np.float64) for of in (image, first, second)]
    # Smooth the weights: those of single pixels contain the noise of the product.
    mean = uniform_filter((linear[1] + linear[2]).mean(axis=-1, keepdims=True) / 2.0, (SMOOTHED, SMOOTHED, 1))
    weight = 1.0 / (mean**2 + 0.01)  # Rousselle et al. 2011
    return displayed, float((weight * (linear[0] - linear[1]) * (linear[0] - linear[2])).mean())


def _image(run: Path, number: int) -> F32:
    name = f"cycles-{number:04d}.exr" if (run / CYCLES_FILE).exists() else f"run/frames/{number:04d}.exr"
    image: F32 = read_exr(run / name)["RGB"].astype(np.float32)
    return image


@click.command()
@click.argument("source", type=click.Path(path_type=Path, exists=True, dir_okay=False))
@click.option(
    "--out", "folder", type=click.Path(path_type=Path), required=True, help="Folder of all results."
)
@click.option("--size", type=Size(), default="320x180", show_default=True, help="Of the images.")
@click.option("--frames", default="1-24", show_default=True, help="Frames that are rendered.")
@click.option("--measured", default="6,12,18", show_default=True, help="Frames that references have.")
@click.option("--spp", default="1,4,16,64", show_default=True, help="Samples of Cycles.")
@click.option("--quality", default="15,8", show_default=True, help="Of --method decoupled.")
@click.option("--reference-spp", default=512, show_default=True, help="Of references, in two halves.")
@click.option("--blender", "program", default="", help="Blender, in place of the one that is found.")
def main(source: Path, folder: Path, spp: str, quality: str, reference_spp: int, **selection: Any) -> None:
    """Render SOURCE by Cycles and by enfilade, and print quality over CPU time."""
    selection |= {name: parse_frames(selection[name]) for name in ("frames", "measured")}
    bench = CyclesBench(source, folder, **selection)
    half = str(reference_spp // len(SEEDS))
    by_cycles = [
        bench.cycles(f"reference-cycles-{seed}", int(half), seed=seed, is_reference=True) for seed in SEEDS
    ]
    rows = [
        bench.row(f"Cycles, {count} spp, denoised", bench.cycles(f"cycles-{count}", count), by_cycles)
        for count in map(int, spp.split(","))
    ]
    flags = ("--method", "reference", "--spp", half, "--seed")
    traced = [bench.enfilade(f"reference-{s}", (*flags, str(s)), is_reference=True) for s in SEEDS]
    rows += [
        bench.row(
            f"decoupled, quality {value}", bench.enfilade(f"decoupled-{value}", ("--quality", value)), traced
        )
        for value in quality.split(",")
    ]
    found = {**origin(), "machine": machine(), "source": source.name, "size": bench.size, "rows": rows}
    write_json(folder / "cycles.json", found)
    for row in rows:
        text = "{name:28} {cpu_s:8.1f} s CPU, PSNR {psnr_db:5.2f} dB, relative RMSE {relative_rmse:.4f}"
        click.echo(text.format(**row))


if __name__ == "__main__":
    main()
