"""Walkthroughs from end to end, on analytic scenes."""

import dataclasses
import itertools
import json
import math
import os

import drjit as dr
import numpy as np
import pytest

from enfilade.camera.path import CameraPath
from enfilade.errors import RunFolderError, SettingsError
from enfilade.images import read_exr
from enfilade.methods.paper.masks import slow_pixels
from enfilade.monitor import Silence
from enfilade.pipeline.inbetween import make_keyframe, read_raw
from enfilade.pipeline.job import Job
from enfilade.pipeline.plan import plan
from enfilade.pipeline.walkthrough import kept, prepare, render
from enfilade.pipeline.workshop import Workshop
from enfilade.records import Provenance, SurfaceClass
from enfilade.renderer import PixelFilter, Purpose
from enfilade.store import Run
from keyframes_analytic import psnr
from scenes_analytic import ball, room, room_walk, slide, wall
from small_runs import colors, frame_bytes, job_of, part_of, rendered, units, with_cut
from support.analytic_scene import AnalyticScene, Material, Plane, Sphere, Waves

PATH = part_of(room_walk(30), range(13))


@pytest.fixture(scope="module")
def paper(tmp_path_factory):
    """A walk through the room, by the paper's method."""
    folder = tmp_path_factory.mktemp("paper")
    job = job_of(folder, room(), PATH)
    return job, *rendered(folder, job)


def test_it_looks_like_the_reference(paper, tmp_path):
    _, _, folder = paper
    job = job_of(tmp_path, room(), PATH, method="reference", trace={"spp": 64})
    summary, reference = rendered(tmp_path, job)
    scores = [psnr(a, b) for a, b in zip(colors(folder), colors(reference), strict=True)]
    # One sample a pixel of sharp checks, filtered over time, against 64 Gaussian ones: the spatial filter
    # is wider where it moves. No frame falls out of line.
    assert min(scores) > 22
    assert max(scores) - min(scores) < 4
    assert summary["table1"]["total"] == 100.0
    assert summary["segments"] == []


def test_each_pixel_is_counted_once(paper):
    job, summary, folder = paper
    pixels = job.path.width * job.path.height
    raw = [line for unit, line in units(folder).items() if unit.startswith("raw")]
    assert len(raw) == len(job.path)
    assert all(sum(line["sources"].values()) == pixels for line in raw)
    table = summary["table1"]
    assert table["total"] == pytest.approx(sum(v for k, v in table.items() if k != "total"))
    assert table["keyframes"] == pytest.approx(100 * 3 / 13)
    assert 0 < table["occlusion"] < 5
    for row in summary["per_frame"]:
        assert row["traced"] == pytest.approx(row["slow"] + row["specular"] + row["hole"] + row["keyframe"])


def test_the_sources_in_the_frames_are_those_of_the_ledger(paper):
    job, _, folder = paper
    lines = units(folder)
    for number in job.path.numbers:
        source = read_exr(folder / "frames" / f"{number:04d}.exr")["source"]
        counts = np.bincount(source.astype(int).ravel(), minlength=5)
        assert lines[f"raw {number}"]["sources"] == {s.name.lower(): counts[s] for s in Source}


def test_the_run_folder_is_complete(paper):
    job, summary, folder = paper
    assert sorted(f.name for f in (folder / "frames").iterdir()) == [f"{n:04d}.exr" for n in job.path.numbers]
    assert (folder / summary["video"]).stat().st_size > 0
    assert json.loads((folder / "summary.json").read_text()) == json.loads(json.dumps(summary))


def test_plan_foresees_the_keyframes(paper):
    job, summary, _ = paper
    foreseen = plan(job, Silence())
    initial = [(s["first"], s["last"]) for s in summary["segments"] if s["depth"] == 0]
    assert [(s["first"], s["last"]) for s in foreseen.segments] == initial
    assert foreseen.keyframes == (1, 7, 13)
    velocities = [row["velocity_deg_s"] for row in summary["per_frame"]]
    assert list(foreseen.mean_speed_deg_s) == pytest.approx(velocities)
    holes = {row["frame"]: row["hole"] for row in summary["per_frame"]}
    looked = {n: p for n, p in zip(foreseen.frames, foreseen.hole_percent, strict=True) if p is not None}
    assert len(looked) > 2
    for number, percent in looked.items():
        assert percent == pytest.approx(holes[number])  # nothing is slow or specular here
    assert foreseen.forecast["shares_percent"]["keyframes"] == pytest.approx(100 * 3 / 13)


def test_the_same_command_does_nothing_again(paper):
    job, summary, folder = paper
    before = frame_bytes(folder)
    ledger = (folder / "ledger.jsonl").read_bytes()
    again, _ = rendered(folder.parent, job)
    assert frame_bytes(folder) == before
    assert (folder / "ledger.jsonl").read_bytes() == ledger
    assert again["table1"] == summary["table1"]
    assert again["table2"] == summary["table2"]


def test_another_run_is_refused(paper):
    job, _, folder = paper
    tables = job.settings.to_tables()
    tables["trace"]["spp"] = 5
    other = dataclasses.replace(job, settings=type(job.settings).from_tables(tables))
    with pytest.raises(RunFolderError, match=r"holds another run(.|\n)*spp") as error:
        rendered(folder.parent, other)
    assert "would be the same" not in str(error.value)
    shorter = dataclasses.replace(job, path=part_of(PATH, range(5)))
    with pytest.raises(RunFolderError, match="holds another run"):
        rendered(folder.parent, shorter)
    with pytest.raises(RunFolderError, match="method"):
        rendered(folder.parent, dataclasses.replace(job, method="reference"))


@pytest.mark.parametrize(
    ("method", "keys", "words"),
    [
        ("paper", ["settings.video.codec", "settings.video.quality"], "everything but the video"),
        ("decoupled", ["settings.video.codec"], "everything but the video"),
        ("paper", ["settings.antialias.frames"], "the keyframes"),
        ("paper", ["settings.antialias.frames", "settings.metric.mask_slope"], "the keyframes"),
        ("decoupled", ["settings.antialias.frames"], ""),
        ("paper", ["settings.video.codec", "scene.fingerprint"], ""),
        ("paper", ["versions.enfilade"], ""),
    ],
)
def test_what_could_be_kept_of_another_run(method, keys, words):
    text = kept(method, keys)
    assert words in text
    assert bool(text) == bool(words)


class Killer(Silence):
    """Interrupts a run after some units."""

    def __init__(self, units):
        self.left = units

    def advance(self, count=1):
        self.left -= count
        if self.left < 0:
            raise KeyboardInterrupt


NOISY = dataclasses.replace(room(specular=True), noise=0.05)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A noisy walk that splits and has specular shapes, never interrupted."""
    folder = tmp_path_factory.mktemp("whole")
    return rendered(folder, resumed_job(folder))[1]


def resumed_job(folder, **tables):
    split = {"masks": {"split_percent": 10.0}, "trace": {"spp": 16}}
    path = room_walk(13, size=(64, 48))
    return job_of(folder, NOISY, path, **(split | tables))


def test_the_walk_to_be_interrupted_has_something_to_lose(whole):
    lines = units(whole)
    assert any(line["verdict"]["is_split"] for line in lines.values() if "verdict" in line)
    assert any(line.get("sources", {}).get("specular", 0) for line in lines.values())
    assert any(line.get("sources", {}).get("hole", 0) for line in lines.values())


@pytest.mark.parametrize("after", [0, 5, 13, 18, 31, 45])
def test_killed_anywhere_it_ends_with_the_same_frames(whole, tmp_path, after):
    job = resumed_job(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        rendered(tmp_path, job, monitor=Killer(after))
    _, folder = rendered(tmp_path, job)
    assert frame_bytes(folder) == frame_bytes(whole)
    video = "video"
    expected, got = units(whole), units(folder)
    assert set(got) == set(expected)
    assert {u: v for u, v in got.items() if u != video} == {u: v for u, v in expected.items() if u != video}


def test_killed_again_and_again(whole, tmp_path):
    # Each attempt gets a little further; what is finished is passed over, and counts as progress too.
    job = resumed_job(tmp_path)
    for patience in itertools.count(3, 7):
        try:
            _, folder = rendered(tmp_path, job, monitor=Killer(patience))
        except KeyboardInterrupt:
            continue
        break
    assert patience > 30
    assert frame_bytes(folder) == frame_bytes(whole)


def test_a_lost_frame_is_made_again(whole, tmp_path):
    job = resumed_job(tmp_path)
    _, folder = rendered(tmp_path, job)
    for name in ("frames/0004.exr", "raw/0005.exr", "keyframes/0007.exr"):
        (folder / name).unlink()
    rendered(tmp_path, job)
    assert frame_bytes(folder) == frame_bytes(whole)


def test_the_chunk_changes_no_byte(whole, tmp_path):
    job = resumed_job(tmp_path, trace={"spp": 16, "chunk": 4096})
    assert frame_bytes(rendered(tmp_path, job)[1]) == frame_bytes(whole)


def still(count, size=(48, 36)):
    return slide(count, step=0.0, size=size)


def test_a_camera_that_stands_still_is_traced_once(tmp_path):
    summary, folder = rendered(tmp_path, job_of(tmp_path, room(noise=0.5), still(12)))
    assert summary["table1"]["total"] == pytest.approx(100 / 12)
    lines = units(folder)
    assert [u for u in lines if u.startswith("keyframe")] == ["keyframe 1"]
    frames = colors(folder)
    # The sum over equal frames is divided by as many weights: float32, then half precision.
    np.testing.assert_allclose(frames, np.broadcast_to(frames[0], frames.shape), rtol=1e-3)


@pytest.mark.parametrize("method", ["paper", "reference"])
def test_a_single_frame(tmp_path, method):
    summary, folder = rendered(tmp_path, job_of(tmp_path, room(), still(1), method=method))
    assert summary["table1"]["total"] == 100.0
    assert len(frame_bytes(folder)) == 1
    assert np.isfinite(colors(folder)).all()


@pytest.mark.parametrize("count", [2, 3])
def test_two_and_three_frames(tmp_path, count):
    path = room_walk(40, size=(48, 36))
    summary, folder = rendered(tmp_path, job_of(tmp_path, room(), part_of(path, range(count))))
    keyframes = [u for u in units(folder) if u.startswith("keyframe")]
    assert keyframes == ["keyframe 1", f"keyframe {count}"]
    assert summary["table1"]["keyframes"] == pytest.approx(200 / count)


def test_a_path_with_stops(tmp_path):
    walk = room_walk(24, size=(48, 36))
    where = [0, 0, 0, 1, 2, 3, 4, 4, 4, 4, 4, 5, 6, 7, 8, 9, 9, 9]
    path = CameraPath(tuple(walk.cameras[i] for i in where), tuple(range(1, 19)), 30.0)
    summary, folder = rendered(tmp_path, job_of(tmp_path, room(noise=0.3), path))
    lines = units(folder)
    traced = [row["traced"] for row in summary["per_frame"]]
    for frame, (a, b) in enumerate(itertools.pairwise(where), 1):
        if a == b:  # a copy: nothing traced
            assert traced[frame] == 0.0
            assert lines[f"raw {frame + 1}"]["sources"]["reused"] == 48 * 36
    assert len([u for u in lines if u.startswith("raw")]) == 18
    assert np.isfinite(colors(folder)).all()


def test_nothing_is_carried_across_a_cut(tmp_path):
    size = (64, 48)
    first, second = room_walk(9, size=size), slide(8, step=0.2, size=size)
    path = CameraPath(first.cameras + second.cameras, tuple(range(1, 18)), 30.0)
    scene = room(noise=0.3)
    (tmp_path / "a").mkdir()
    _, together = rendered(tmp_path, job_of(tmp_path, scene, with_cut(path, 9)))
    frames = colors(together)
    for name, span in (("a", range(9)), ("b", range(9, 17))):
        _, alone = rendered(tmp_path, job_of(tmp_path, scene, part_of(path, span)), name)
        np.testing.assert_array_equal(frames[span.start : span.stop], colors(alone))
    assert {"keyframe 9", "keyframe 10"} <= set(units(together))


def test_samples_that_are_not_finite_are_counted_and_left_out(tmp_path):
    path = room_walk(7, size=(48, 36))
    clean = colors(rendered(tmp_path, job_of(tmp_path, room(), path, trace={"spp": 16}), "clean")[1])
    job = job_of(tmp_path, room(nan_share=0.05), path, trace={"spp": 16})
    summary, folder = rendered(tmp_path, job, "spoiled")
    spoiled = colors(folder)
    assert np.isfinite(spoiled).all()
    np.testing.assert_allclose(spoiled.mean(), clean.mean(), rtol=0.01)  # nothing is darker for it
    traced = sum(row["traced"] for row in summary["per_frame"]) / 100 * 48 * 36 * 16
    assert abs(summary["dropped_samples"] - 0.05 * traced) < 5 * math.sqrt(0.05 * 0.95 * traced)


def segments_of(tmp_path, scene, path, name="run", **tables):
    job = job_of(tmp_path, scene, path, **({"masks": {"split_percent": 10.0}} | tables))
    return rendered(tmp_path, job, name)[0]["segments"]


@pytest.mark.parametrize("spp", [2, 4, 16])
def test_noise_splits_no_segment(tmp_path, spp):
    path = slide(13, step=0.06, size=(96, 72))
    segments = segments_of(tmp_path, wall(noise=1.0), path, trace={"spp": spp})
    assert not any(s["is_split"] for s in segments)
    assert len(segments) == 2


def shiny(gloss, noise):
    """A wall with a highlight that wanders over it as the camera moves."""
    paint = Waves((0.2, 0.3, 0.4), (0.4, 0.4, 0.3), period=1.3)
    material = Material(paint, SurfaceClass.GLOSSY, gloss=gloss, shininess=40)
    plain = Material(Waves((0.2, 0.3, 0.4), (0.4, 0.4, 0.3), period=1.1))
    return AnalyticScene(
        (Plane((0, 0, 0), (0, 0, 1), material, "shiny"), Sphere((1, -0.6, 0.2), 0.4, plain, "ball")),
        to_light=(0.2, 0.1, 1.0),
        noise=noise,
    )


def test_a_highlight_that_moves_is_seen_through_the_noise(tmp_path):
    path = slide(13, step=0.08, size=(96, 72))
    selected = segments_of(tmp_path, shiny(0.6, 0.25), path, trace={"spp": 64})
    assert [s["unseen_items"] for s in selected] == [0, 0]
    # What is traced anyway does not count, nor what the metric spreads from it over the ball.
    assert not any(s["is_split"] for s in selected)
    faint = segments_of(tmp_path, shiny(0.002, 0.25), path, "faint", trace={"spp": 64})
    assert [s["unseen_items"] for s in faint] == [1, 1]


def test_a_surface_that_changes_with_the_view_unannounced_splits(tmp_path):
    # Items may not be selected, so that only splitting is left.
    never = {"split_percent": 10.0, "specular_jnd": 1e6, "specular_percent": 100.0}
    path = slide(13, step=0.08, size=(96, 72))
    segments = segments_of(tmp_path, shiny(0.6, 0.0), path, masks=never)
    assert any(s["is_split"] for s in segments)
    assert all(s["unseen_items"] for s in segments if s["middle"] is not None)
    depths = [s["depth"] for s in segments]
    assert max(depths) >= 1


def test_a_single_path_is_refused(tmp_path):
    # It says nothing of its variance: the metric would take all noise for differences.
    with pytest.raises(SettingsError, match="--spp 2 or more"):
        rendered(tmp_path, job_of(tmp_path, wall(), slide(3), trace={"spp": 1}))


def test_splitting_ends_where_it_does_not_help(tmp_path):
    # Checks sampled at pixel centres, 4 px/deg, no noise: both warps alias differently however near they are.
    masks = {"split_percent": 10.0}
    segments = segments_of(tmp_path, room(), room_walk(33), trace={"spp": 2}, masks=masks)
    assert segments[0]["is_split"]
    for s in segments:
        if s["is_split"] and s["depth"]:
            (whole,) = (
                w
                for w in segments
                if w["depth"] == s["depth"] - 1 and w["first"] <= s["first"] and s["last"] <= w["last"]
            )
            assert s["percent_visible"] < 0.9 * whole["percent_visible"]
    kept = [s for s in segments if not s["is_split"]]
    assert any(s["percent_visible"] > 10.0 for s in kept)
    assert len(kept) < 16


@pytest.mark.parametrize("before", [1, 2, 9, 37])
def test_killed_before_the_ledger_knows_of_a_file(whole, tmp_path, monkeypatch, before):
    job = resumed_job(tmp_path)
    finish, calls = Workshop.finish, itertools.count(1)

    def killed(self, unit, files, **facts):
        if next(calls) == before:
            raise KeyboardInterrupt
        finish(self, unit, files, **facts)

    with monkeypatch.context() as patch:
        patch.setattr(Workshop, "finish", killed)
        with pytest.raises(KeyboardInterrupt):
            rendered(tmp_path, job)
    _, folder = rendered(tmp_path, job)
    assert frame_bytes(folder) == frame_bytes(whole)


def test_no_kernel_is_compiled_from_frame_to_frame(tmp_path):
    def walk(name, *, fov_deg, seed, frames):
        cameras = tuple(
            dataclasses.replace(c, fov_deg=fov_deg) for c in room_walk(frames, size=(48, 36)).cameras
        )
        path = CameraPath(cameras, tuple(range(seed, seed + frames)), 30.0)
        masks = {"split_percent": 100.0, "slow_deg_s": 2.0}
        job = job_of(tmp_path, room(noise=0.3), path, trace={"seed": seed, "spp": 4 + seed}, masks=masks)
        rendered(tmp_path, job, name)

    walk("first", fov_deg=50.0, seed=1, frames=20)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        walk("second", fov_deg=42.0, seed=2, frames=23)
        kernels = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert len(kernels) > 100
    assert not [k for k in kernels if not k["cache_hit"]]


def test_where_the_camera_rests_the_image_is_antialiased(tmp_path):
    # The frame that a rest repeats is looked at for long: its paths are spread over the pixels.
    walk = room_walk(24)
    where = [0, 1, 2, 3, 4, 5, 6, *[7] * 11, 8, 9, 10, 11]
    path = CameraPath(tuple(walk.cameras[i] for i in where), tuple(range(1, len(where) + 1)), 30.0)
    job = job_of(tmp_path, room(), path, trace={"spp": 16})
    summary, folder = rendered(tmp_path, job)
    traced = [row["traced"] for row in summary["per_frame"]]
    assert traced[7] == 100.0
    assert traced[8:18] == [0.0] * 10
    reference = job_of(tmp_path, room(), path, method="reference", trace={"spp": 64})
    truth = colors(rendered(tmp_path, reference, "reference")[1])
    scores = [psnr(a, b) for a, b in zip(colors(folder), truth, strict=True)]
    assert min(scores[9:16]) > max(scores[2:5]) + 3


def test_what_is_warped_from_a_rest_goes_through_the_pixels_centres(tmp_path):
    # All of the first keyframe is slow, and all that it is warped into is fast.
    walk = room_walk(24)
    path = CameraPath(tuple(walk.cameras[max(i, 0)] for i in range(-8, 9)), tuple(range(1, 18)), 30.0)
    job = job_of(tmp_path, room(), path, trace={"spp": 4})
    renderer = job.open_renderer()
    with Run.open(tmp_path / "run", job.identity(renderer)) as run:
        workshop = Workshop(job, renderer, run, Silence())
        assert slow_pixels(workshop.views[0].speed_deg_s, job.settings.masks).all()
        warped = workshop.keyframe(0).shading.color
        make_keyframe(workshop, 0)
        delivered = read_raw(workshop, 0).color
        everywhere = np.ones(warped.shape[:2], bool)
        centre = workshop.trace(0, everywhere, Purpose.KEYFRAME, PixelFilter.CENTRE)
        spread = workshop.trace(0, everywhere, Purpose.FILL, PixelFilter.BOX)
    np.testing.assert_array_equal(warped.reshape(-1, 3), centre.color)
    np.testing.assert_array_equal(delivered.reshape(-1, 3), spread.color)


def test_holes_are_foreseen_where_the_camera_moves(tmp_path):
    walk = room_walk(24)
    path = CameraPath(tuple(walk.cameras[max(i, 0)] for i in range(-18, 6)), tuple(range(1, 25)), 30.0)
    foreseen = plan(job_of(tmp_path, room(), path), Silence())
    looked_at = [frame for frame, percent in enumerate(foreseen.hole_percent) if percent is not None]
    assert looked_at
    assert min(looked_at) > 18


def test_a_scene_is_tried_before_its_run_begins_also_where_its_folder_is_there(tmp_path, monkeypatch):
    tried = []
    monkeypatch.setattr(Job, "check_scene", lambda _, *, is_tried=False: tried.append(is_tried))
    (tmp_path / "run").mkdir()
    job = job_of(tmp_path, room(), PATH)
    prepare(job, tmp_path / "run", is_tried=True)
    prepare(job, tmp_path / "run", is_tried=True)
    assert tried == [False, True, False]


def test_a_folder_that_can_hold_no_run_is_refused_before_the_scene_is_tried(tmp_path, monkeypatch):
    tried = []
    monkeypatch.setattr(Job, "check_scene", lambda _, *, is_tried=False: tried.append(is_tried))
    job = job_of(tmp_path, room(), PATH)
    foreign, forbidden = tmp_path / "foreign", tmp_path / "forbidden"
    foreign.mkdir()
    (foreign / "letter.txt").write_text("")
    monkeypatch.setattr(os, "access", lambda place, _mode: forbidden not in place.parents)
    for folder, words in (
        (foreign, "is not empty and holds no run"),
        (foreign / "letter.txt" / "run", "can't make a run in"),
        (forbidden / "run", "can't write in"),
    ):
        with pytest.raises(RunFolderError, match=words):
            prepare(job, folder, is_tried=True)
        with pytest.raises(RunFolderError, match=words):
            render(job, folder, Silence(), is_tried=True)
    assert True not in tried
    assert not forbidden.exists()


def test_the_sky_is_far_in_the_depth_that_is_delivered(tmp_path):
    job = job_of(tmp_path, ball(), slide(2), output={"layers": "Z,item"})
    _, folder = rendered(tmp_path, job)
    layers = read_exr(folder / "frames" / "0001.exr")
    is_sky = layers["item"] == 0
    assert is_sky.any()
    assert layers["Z"][is_sky].min() > 9e9
    assert 0.0 < layers["Z"][~is_sky].min() < layers["Z"][~is_sky].max() < 10.0
