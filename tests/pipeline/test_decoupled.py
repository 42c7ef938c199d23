"""Walkthroughs by ``--method decoupled``."""

from dataclasses import replace

import numpy as np
import pytest

from enfilade.camera import load_path
from enfilade.camera.path import CameraPath, Segment
from enfilade.camera.pinhole import Camera, look_at
from enfilade.errors import SettingsError
from enfilade.images import read_exr
from enfilade.monitor import Silence
from enfilade.pipeline.crew import Crew
from enfilade.pipeline.job import Job
from enfilade.pipeline.plan import plan
from enfilade.pipeline.rehearsal import excerpt_of
from enfilade.pipeline.share import Share, do_share, go_on
from enfilade.pipeline.units import STEPS
from enfilade.pipeline.walkthrough import prepare, render
from enfilade.settings import Settings
from enfilade.store import Run
from scenes_analytic import slide, wall
from small_runs import frame_bytes, job_of, rendered
from studies.scenes import write_scene

FRAMES = (1, 22, 24, 26, 28)


def _job(folder, method: str, spp: int) -> Job:
    files = write_scene("room", folder / "room", preset="small")
    path = load_path(files.path, size=(64, 48), frames=FRAMES)
    settings = Settings.from_tables(
        {"trace": {"spp": spp}, "light": {"spacing": 4, "paths": spp, "samples": 8}}
    )
    return Job(files.scene, path, settings, method)


@pytest.fixture(scope="module")
def decoupled(tmp_path_factory):
    folder = tmp_path_factory.mktemp("decoupled")
    return (
        _job(folder, "decoupled", 32),
        folder / "run",
        render(_job(folder, "decoupled", 32), folder / "run", Silence()),
    )


def test_it_is_about_as_near_to_many_paths_as_tracing_every_frame_with_as_many(decoupled, tmp_path):
    _, folder, summary = decoupled
    render(_job(tmp_path, "reference", 256), tmp_path / "many", Silence())
    render(_job(tmp_path, "reference", 32), tmp_path / "few", Silence())

    def error(run):
        images = [
            [read_exr(r / "frames" / f"{n:04d}.exr")["RGB"].astype(float) for n in FRAMES]
            for r in (run, tmp_path / "many")
        ]
        return np.sqrt(np.mean(np.minimum(np.subtract(*images) ** 2, 1.0)))

    # Two frames of five are traced. The reference has noise of its own, and eight camera rays alias checks.
    assert error(folder) < 1.25 * error(tmp_path / "few")
    assert summary["table1"]["keyframes"] == pytest.approx(100 * 2 / 5)
    assert summary["dropped_samples"] == 0


def test_its_rays_are_counted(decoupled):
    job, folder, summary = decoupled
    rays, light = summary["rays"], job.settings.light
    assert light.least_samples < rays["camera"] <= light.samples
    assert rays["lobes"] == 0.0  # everything is diffuse
    lines = list(Run.existing(folder).lines())
    assert sum(sum(line.get("rays", {}).values()) for line in lines) == pytest.approx(
        sum(rays.values()) * len(FRAMES) * 64 * 48
    )
    # Both keyframes are traced whole, and where fills see more a few pixels besides.
    assert rays["light"] == pytest.approx(2 / 5 * light.paths, rel=0.1)
    by_frame = {row["frame"]: row for row in summary["rays_per_frame"]}
    assert by_frame[1]["drafts"] > 0.0 == by_frame[26]["drafts"]


def test_a_plan_rehearses_a_segment(decoupled):
    job, _, summary = decoupled
    made = plan(job, Silence())
    forecast = made.forecast
    assert made.keyframes == (1, 28)  # of five frames
    assert forecast["rehearsed_frames"] == len(FRAMES)
    assert forecast["rehearsed_size"] == [64, 48]
    assert forecast["paths"] == job.settings.light.paths
    # The segment is all there is.
    assert forecast["rays"] == pytest.approx(summary["rays"])
    assert forecast["seconds"] > 0.0
    larger = replace(
        job,
        path=replace(job.path, cameras=tuple(replace(c, width=640, height=480) for c in job.path.cameras)),
    )
    excerpt = excerpt_of(larger.path, Segment(1, 3))
    assert (excerpt.width, excerpt.height, excerpt.numbers) == (365, 274, FRAMES[1:4])


def test_a_run_that_lost_files_is_mended_to_the_same_bytes(decoupled):
    job, folder, _ = decoupled
    before = frame_bytes(folder)
    (folder / "frames" / "0024.exr").unlink()
    (folder / "keyframes" / "0001.exr").unlink()
    render(job, folder, Silence())
    assert frame_bytes(folder) == before


def test_frames_that_show_glass_are_mended_to_the_same_bytes(tmp_path):
    files, folder = write_scene("atrium", tmp_path / "atrium", preset="small"), tmp_path / "run"
    path = load_path(files.path, size=(64, 48), frames=(29, 30, 31, 32))
    settings = Settings.from_tables({"light": {"spacing": 4, "paths": 4}})
    job = Job(files.scene, path, settings, "decoupled")
    render(job, folder, Silence())
    assert read_exr(folder / "raw" / "0030.exr")["transmitted"].any()
    before = frame_bytes(folder)
    (folder / "frames" / "0030.exr").unlink()  # made of what its neighbours left
    (folder / "raw" / "0032.exr").unlink()
    render(job, folder, Silence())
    assert frame_bytes(folder) == before


def test_lost_fills_are_traced_by_workers_as_they_were(decoupled):
    job, folder, _ = decoupled
    run = Run.existing(folder)
    before, digest = frame_bytes(folder), run.digest()
    fills = [number for line in run.lines() for number in line.get("fills", ())]
    assert fills  # pages of a few pixels: traced whole they would be others
    for name in (f"keyframes/{fills[0]:04d}.exr", "cells/0001.npz", "frames/0024.exr"):
        (folder / name).unlink()
    render(job, folder, Silence(), Crew("processes", 2))
    assert frame_bytes(folder) == before
    assert Run.existing(folder).digest() == digest


def test_a_renderer_that_does_not_split_lobes_is_refused(tmp_path):
    with pytest.raises(SettingsError, match="'analytic' does not estimate lobes apart"):
        rendered(tmp_path, job_of(tmp_path, wall(), slide(3), method="decoupled"))


def test_a_scene_whose_light_can_not_be_told_apart_is_refused_at_once(tmp_path):
    job = _job(tmp_path, "decoupled", 32)
    integrator = '<integrator type="path">'
    hidden = f'{integrator}<boolean name="hide_emitters" value="true"/>'
    text = job.scene.read_text()
    assert integrator in text
    job.scene.write_text(text.replace(integrator, hidden))
    with pytest.raises(SettingsError, match="hides the emitters; take --method paper"):
        render(job, tmp_path / "run", Silence())
    assert list(Run.existing(tmp_path / "run").lines()) == []


@pytest.mark.parametrize("views", [(0, 1, 2, 2, 2), (2, 2, 2)])
def test_a_camera_that_comes_to_rest(decoupled, tmp_path, views):
    job, _, _ = decoupled
    cameras = tuple(job.path.cameras[view] for view in views)
    path = replace(job.path, cameras=cameras, numbers=tuple(range(1, len(views) + 1)))
    summary = render(replace(job, path=path), tmp_path / "run", Silence())
    assert summary["table1"]["keyframes"] > 0.0
    frames = [read_exr(tmp_path / "run" / "frames" / f"{n:04d}.exr")["RGB"] for n in path.numbers]
    assert all(np.isfinite(frame).all() for frame in frames)
    # What rests is shaded once.
    np.testing.assert_array_equal(frames[-1], frames[-2])
    assert np.abs(frames[-1].astype(float)).min() >= 0.0
    shaded = [
        line["unit"] for line in Run.existing(tmp_path / "run").lines() if line["unit"].startswith("raw ")
    ]
    assert len(shaded) == len(set(views))
    assert plan(replace(job, path=path), Silence()).forecast["seconds"] > 0.0


def test_lamps_smaller_than_a_pixel_keep_their_light(tmp_path):
    """Four camera rays miss most of them."""
    pixel = 2.0 * 4.0 * np.tan(np.radians(20.0)) / 48
    side, places = 0.3, [(x, y) for x in np.linspace(-1.3, 1.3, 7) for y in np.linspace(-1.0, 1.0, 5)]
    shape = (
        '<shape type="rectangle"><transform name="to_world"><scale value="{}"/><translate {}/></transform>'
    )
    glow = '<emitter type="area"><rgb name="radiance" value="{}"/></emitter></shape>'
    black = '<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>'
    lamps = [shape.format(0.5 * side * pixel, f'x="{x}" y="{y}"') + glow.format(100) for x, y in places]
    wall_behind = shape.format(9, 'z="-0.01"') + black + glow.format(0.5)
    inside = "".join(['<integrator type="path"/>', wall_behind, *lamps])
    (tmp_path / "scene.xml").write_text(f'<scene version="3.0.0">{inside}</scene>')
    eyes = [(0.013 * k, 0.007 * k, 4.0) for k in range(3)]
    cameras = tuple(Camera(look_at(eye, (*eye[:2], 0.0)), 40, 64, 48) for eye in eyes)
    job = Job(tmp_path / "scene.xml", CameraPath(cameras, (1, 2, 3), 24.0), Settings(), "decoupled")
    render(job, tmp_path / "run", Silence())
    frames = [read_exr(file)["RGB"].astype(float) for file in sorted((tmp_path / "run/frames").iterdir())]
    found = (np.mean(frames, axis=(0, 3)) - 0.5).sum()
    assert found == pytest.approx(len(places) * 99.5 * side**2, rel=0.12)


def test_shares_of_every_step_make_the_same_run(decoupled, tmp_path):
    job, whole, _ = decoupled
    folder = tmp_path / "run"
    prepare(job, folder)
    for step in STEPS["decoupled"]:
        count = 2 if step.name == "shading" else 1  # a frame needs some that others have shaded
        for number in range(1, count + 1):
            do_share(folder, Share(step.name, number, count), Silence(), Crew())
    left = {line["unit"] for line in Run.existing(whole).lines()}
    left -= {line["unit"] for line in Run.existing(folder).lines()}
    assert left == {"video"}
    go_on(folder, Silence(), Crew())
    assert Run.existing(folder).digest() == Run.existing(whole).digest()
