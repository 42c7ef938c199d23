"""Forecasts: what a plan refuses, and how a rehearsal is multiplied."""

import pytest

from enfilade.camera.path import CameraPath, Segment
from enfilade.camera.pinhole import Camera, look_at
from enfilade.errors import InputError, SettingsError
from enfilade.monitor import Silence
from enfilade.pipeline import rehearsal
from enfilade.pipeline.job import Job
from enfilade.pipeline.kept import nearest
from enfilade.pipeline.light import paths_for
from enfilade.pipeline.plan import plan
from enfilade.pipeline.rehearsal import excerpt_of, forecast_decoupled
from enfilade.pipeline.walkthrough import prepare
from enfilade.settings import Settings
from enfilade.store import Run
from scenes_analytic import room_walk, slide, wall
from small_runs import Told, job_of

PIXELS = 8 * 6
JND, QUALITY = 8.0, 1.0  # of the pilot; asked for


def test_too_few_paths_to_know_their_noise_are_refused(tmp_path):
    job = job_of(tmp_path, wall(), slide(3), trace={"spp": 1})
    with pytest.raises(SettingsError, match="--method paper needs --spp 2 or more"):
        plan(job, Silence())


@pytest.mark.parametrize(
    ("size", "tables", "words"),
    [
        ((65, 48), {"video": {"codec": "av1"}}, "65x48"),
        ((64, 48), {"video": {"codec": "ffv1", "view": "Film"}}, "Film"),
        ((64, 48), {"viewing": {"black_cd_m2": 900.0}}, "less than peak_cd_m2"),
    ],
)
def test_what_render_would_refuse_is_refused(tmp_path, monkeypatch, size, tables, words):
    opened = []
    monkeypatch.setattr(Job, "open_renderer", lambda _: opened.append(1))
    job = job_of(tmp_path, wall(), slide(3, size=size), **tables)
    with pytest.raises(InputError, match=words):
        plan(job, Silence())
    with pytest.raises(InputError, match=words):
        prepare(job, tmp_path / "run")
    assert not opened


def test_a_scene_unfit_for_the_method_is_refused_before_its_frames_are_looked_at(tmp_path):
    file = tmp_path / "scene.xml"
    file.write_text(
        '<scene version="3.0.0"><integrator type="direct"/><shape type="sphere"/>'
        '<emitter type="constant"/></scene>'
    )
    told = Told()
    with pytest.raises(SettingsError, match=r"not a path tracer; take --method paper"):
        plan(Job(file, slide(3), Settings(), "decoupled"), told)
    assert told.stages == []


def test_a_rest_is_not_rehearsed():
    def at(x):
        return Camera(look_at((x, 0, 1), (x, 0, 0)), 50.0, 64, 48)

    cameras = (at(0), at(1), at(2), *[at(3)] * 40, *(at(x) for x in range(4, 12)))
    path = CameraPath(cameras, tuple(range(1, len(cameras) + 1)), 30.0)
    assert excerpt_of(path, Segment(3, 44)).numbers == (4, 44, 45)
    # From the keyframe at which the rest begins, the nearest on the path.
    keyframes = [0, 3, 44, 47, 50]
    assert nearest(path, keyframes, 40, 2) == [3, 44]
    assert nearest(path, keyframes, 42, 3) == [3, 44, 0]


class Bar:
    """A monitor that counts: of each stage, what is done and what is to be done."""

    def __init__(self):
        self.counts, self.said, self.now = {}, [], ""

    def stage(self, name, total):
        self.now = name
        self.counts.setdefault(name, [0, 0])[1] += total

    def advance(self, count=1):
        self.counts[self.now][0] += count

    def extend(self, count):
        self.counts[self.now][1] += count

    def say(self, text):
        self.said.append(text)


def rehearse(job, folder, monitor):
    """Stands for a render of five frames of a shot that begins and ends with a keyframe."""
    monitor.stage("survey", 1)
    monitor.advance()
    monitor.stage("light", 5)
    monitor.extend(1)
    monitor.advance(6)
    monitor.say("light 1-5: it is tried again")
    assert len(job.path) == 5
    paths = paths_for(JND, QUALITY, 2)
    drafts, light = {"drafts": 3 * PIXELS}, {"light": paths * PIXELS}
    units = [
        ("survey", 5.0, {}),
        *((f"draft {n}", 2.0, {"frame": n, "rays": drafts}) for n in (1, 5)),
        *((f"cells {n}", 3.0, {}) for n in (1, 5)),
        ("pilot 5", 7.0, {"frame": 5, "jnd": JND, "paths": paths, "rays": {"drafts": 8 * PIXELS}}),
        *((f"keyframe {n}", 11.0, {"frame": n, "rays": light}) for n in (1, 5)),
        ("keyframe 3", 0.5, {"frame": 3}),
        ("light 1-5", 13.0, {"fills": [3]}),
        *((f"raw {n}", 17.0, {}) for n in range(1, 6)),
        *((f"frame {n}", 19.0, {"rays": {"camera": 4 * PIXELS}, "frame": n}) for n in range(1, 6)),
        ("video", 5.0, {}),
    ]
    with Run.open(folder, job.identity()) as run:
        for name, cpu_s, facts in units:
            cost = {"work": {"cpu_s": cpu_s, "wall_s": cpu_s / 2}}
            run.finish(name, files=[], facts={"cost": cost, **facts})


def test_a_rehearsed_segment_is_multiplied_shot_by_shot(tmp_path, monkeypatch):
    """Two shots, of 2 and of 8 keyframes: each has a pilot, and the longer one pools the light of more."""
    monkeypatch.setattr(rehearsal, "render", rehearse)
    light = {"quality": QUALITY, "denoiser": "none"}
    job = job_of(tmp_path, wall(), room_walk(20, size=(8, 6)), method="decoupled", light=light)
    shots = [[Segment(0, 4)], [Segment(first, first + 2) for first in range(5, 19, 2)]]
    bar = Bar()
    found = forecast_decoupled(job, shots, bar)
    assert (bar.counts, bar.said) == ({"rehearsal": [7, 7]}, ["light 1-5: it is tried again"])
    assert (paths_for(JND, QUALITY, 2), paths_for(JND, QUALITY, 8)) == (128, 32)
    mean = (2 * 128 + 8 * 32) / 10
    assert found["paths"] == round(mean)
    cpu_s = {
        "survey and video": 4 * (5.0 + 5.0),
        "keyframes": 10 * (2.0 + 3.0 + 11.0 * mean / 128),
        "fills": 8 * 0.5 * mean / 128,
        "pilots": 2 * 7.0,
        "segments": 8 * 13.0,
        "frames": 20 * (17.0 + 19.0),
    }
    assert found["cpu_seconds"] == pytest.approx(sum(cpu_s.values()))
    assert found["seconds"] == pytest.approx(sum(cpu_s.values()) / 2)
    drafts = (10 * 3 + 2 * 8) / 20
    assert found["rays"] == pytest.approx(
        {"camera": 4.0, "lobes": 0.0, "light": 10 * mean / 20, "drafts": drafts}
    )
