"""Jobs: what identifies a run and what does not, and the way through JSON."""

from __future__ import annotations

import dataclasses
import itertools
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import enfilade
from enfilade.errors import RunFolderError, SceneError, SettingsError
from enfilade.methods.denoise import denoiser_name
from enfilade.methods.opener import name_of
from enfilade.methods.paper import Paper
from enfilade.runs.job import Job, read_job, write_job
from enfilade.runs.render import prepare
from enfilade.scene.opener import Scene
from enfilade.settings import SECTIONS, Settings, VideoSettings
from support.toy_method import ToySettings
from support.toys import slide, toy_job


def settings(**tables):
    return Settings.from_tables(tables, [*SECTIONS, ToySettings])


def shifted(path):
    """A path whose last camera has a shifted lens."""
    last = dataclasses.replace(path.cameras[-1], principal_point=(0.5, 0.75))
    return dataclasses.replace(path, cameras=(*path.cameras[:-1], last))


def test_the_way_through_json_changes_nothing(tmp_path):
    path = slide(4, cuts=(2,))
    path = shifted(path)
    cameras = [dataclasses.replace(path.cameras[0], fov_deg=np.float64(50)), *path.cameras[1:]]
    job = toy_job(tmp_path, path=dataclasses.replace(path, cameras=tuple(cameras), fps=24), toy={"gain": 2.0})
    again = Job.from_json(json.loads(json.dumps(job.to_json())))
    assert again.identity() == job.identity()
    assert again.to_json() == job.to_json()
    assert again.settings[ToySettings].gain == 2.0
    prepare(job, tmp_path / "run")
    assert read_job(tmp_path / "run").identity() == job.identity()
    prepare(read_job(tmp_path / "run"), tmp_path / "run")


def test_a_folder_may_be_moved_with_the_files_in_it(tmp_path):
    run, moved = tmp_path / "run", tmp_path / "moved"
    job = toy_job(tmp_path)
    file = run / "scene" / job.scene.file.name
    file.parent.mkdir(parents=True)
    file.write_bytes(job.scene.file.read_bytes())
    view = file.with_name("config.ocio")
    view.touch()
    video = job.settings.replace(VideoSettings, ocio=str(view))
    write_job(run, dataclasses.replace(job, scene=dataclasses.replace(job.scene, file=file), settings=video))
    run.rename(moved)
    again = read_job(moved)
    assert again.scene.file == moved / "scene" / file.name
    assert again.settings[VideoSettings].ocio == str(moved / "scene" / "config.ocio")
    write_job(moved, job)  # whose files are elsewhere
    assert read_job(moved).scene.file == job.scene.file
    assert read_job(moved).settings[VideoSettings].ocio == ""


def test_a_configuration_of_opencolorio_is_found_from_any_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    job = toy_job(tmp_path)
    for given, kept in (("ocio://default", "ocio://default"), ("my.ocio", str(tmp_path / "my.ocio"))):
        write_job(tmp_path / "run", dataclasses.replace(job, settings=settings(video={"ocio": given})))
        assert read_job(tmp_path / "run").settings[VideoSettings].ocio == kept


def test_a_method_is_given_by_name_or_class():
    assert name_of("paper") == name_of(Paper) == "paper"
    with pytest.raises(SettingsError, match="is no class"):
        name_of(Paper())


def test_settings_that_the_method_does_not_read_do_not_count(tmp_path):
    job = toy_job(tmp_path)
    for tables in (
        {"warp": {"max_magnification": 2.0}, "sampling": {"spp": 3}},
        {"viewing": {"exposure_ev": 1.0, "distance_m": 2.0}, "video": {"codec": "h264"}},
        {"limits": {"paths_in_flight": 2048, "task_timeout_s": 5.0}},
    ):
        assert dataclasses.replace(job, settings=settings(**tables)).identity() == job.identity()


@pytest.mark.parametrize(
    ("key", "changed"),
    [
        ("settings", lambda job: dataclasses.replace(job, settings=settings(trace={"seed": 1}))),
        ("settings", lambda job: dataclasses.replace(job, settings=settings(toy={"gain": 2.0}))),
        ("settings", lambda job: dataclasses.replace(job, settings=settings(output={"layers": "Z"}))),
        ("path", lambda job: dataclasses.replace(job, path=slide(5))),
        ("path", lambda job: dataclasses.replace(job, path=shifted(job.path))),
        ("path", lambda job: dataclasses.replace(job, path=slide(4, cuts=(2,)))),
        ("path", lambda job: dataclasses.replace(job, path=slide(4, size=(9, 6)))),
        ("scene", lambda job: dataclasses.replace(job, scene=other_scene(job.scene))),
        ("method", lambda job: dataclasses.replace(job, method="reference")),
    ],
)
def test_everything_else_counts(tmp_path, key, changed):
    job = toy_job(tmp_path)
    before, after = job.identity(), changed(job).identity()
    assert before[key] != after[key]
    assert set(before) == {"enfilade", "method", "scene", "path", "settings"}


def test_the_denoiser_counts_where_it_is_used(tmp_path):
    name = denoiser_name()
    for denoiser, expected in (("balanced", name), ("none", None)):
        job = toy_job(tmp_path, method="decoupled", decoupled={"denoiser": denoiser})
        assert job.identity()["method"].get("denoiser") == expected


def test_layers_count_in_any_order(tmp_path):
    one, other = (toy_job(tmp_path, output={"layers": text}) for text in ("N, Z", ["Z", "N"]))
    assert one.identity() == other.identity()
    prepare(toy_job(tmp_path, output={"layers": "N,Z"}), tmp_path / "run")
    prepare(other, tmp_path / "run")


def other_scene(scene):
    file = scene.file.with_name("other.txt")
    file.write_text("another wall")
    return Scene(file, scene.renderer)


IDENTITY = """
import json, sys
from pathlib import Path
import enfilade
from enfilade.device import activate
activate("cpu")
from enfilade.runs.job import Job
print(json.dumps([enfilade.__file__, Job.from_json(json.loads(sys.argv[1])).identity()]))
"""


def test_a_comment_in_the_source_changes_no_identity(tmp_path):
    shutil.copytree(Path(enfilade.__file__).parent, tmp_path / "src" / "enfilade")
    method = tmp_path / "src" / "enfilade" / "methods" / "reference.py"
    method.write_text(f"{method.read_text()}# a comment\n")
    job = toy_job(tmp_path, method="reference")
    path = os.pathsep.join([str(tmp_path / "src"), *sys.path])
    done = subprocess.run(  # noqa: S603
        [sys.executable, "-c", IDENTITY, json.dumps(job.to_json())],
        env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    where, identity = json.loads(done.stdout)
    assert where.startswith(str(tmp_path))
    expected = job.identity()
    identity["scene"]["variant"] = expected["scene"]["variant"]  # this process may be on a GPU
    assert identity == expected


def test_the_video_has_an_identity_of_its_own(tmp_path):
    different = ({}, {"video": {"quality": 20}}, {"viewing": {"exposure_ev": 1.0}})
    found = [toy_job(tmp_path, **tables).video_identity for tables in different]
    ocio = pytest.importorskip("PyOpenColorIO")
    (tmp_path / "config.ocio").write_text(OCIO)
    for middle in (0.6, 0.7):  # the configuration is the same file, a table of it changes
        (tmp_path / "look.cube").write_text(f"LUT_1D_SIZE 3\n0 0 0\n{middle} {middle} {middle}\n1 1 1\n")
        ocio.ClearAllCaches()
        found.append(toy_job(tmp_path, video={"ocio": str(tmp_path / "config.ocio")}).video_identity)
    assert all(a != b for a, b in itertools.combinations(found, 2))


OCIO = """ocio_profile_version: 2
search_path: "."
roles: {default: raw, scene_linear: lin_rec709}
displays:
  sRGB:
    - !<View> {name: Plain, colorspace: encoded}
active_displays: []
active_views: []
colorspaces:
  - !<ColorSpace> {name: raw, isdata: true}
  - !<ColorSpace> {name: lin_rec709}
  - !<ColorSpace>
    name: encoded
    from_scene_reference: !<FileTransform> {src: look.cube, interpolation: linear}
"""


def test_jobs_that_can_not_be_read(tmp_path):
    with pytest.raises(RunFolderError, match="holds no run; begin one"):
        read_job(tmp_path)
    for text in ("{", "[]", '{"path": {}}', '{"path": {"size": [1e999, 1], "poses": []}}'):
        (tmp_path / "job.json").write_text(text)
        with pytest.raises(RunFolderError, match=r"job\.json is damaged"):
            read_job(tmp_path)
    table = toy_job(tmp_path).to_json()
    (tmp_path / "job.json").write_text(json.dumps({**table, "method": "support.missing:Method"}))
    with pytest.raises(SettingsError, match="can't be imported"):
        read_job(tmp_path)


def test_wrong_input_is_refused_before_the_scene_is_loaded(tmp_path):
    job = toy_job(tmp_path, path=slide(2, size=(65, 48)))
    with pytest.raises(SettingsError, match="65x48"):
        dataclasses.replace(job, settings=job.settings.replace(VideoSettings, codec="av1")).check()
    fast = toy_job(
        tmp_path, path=dataclasses.replace(slide(2, size=(64, 64)), fps=250.0), video={"codec": "av1"}
    )
    with pytest.raises(SettingsError, match="250 frames per second"):
        fast.check()
    for name in ("fast", ".support:Toy", ":Toy"):
        with pytest.raises(SettingsError, match=f"no method '{name}'"):
            dataclasses.replace(job, method=name).check()
    job.scene.file.unlink()
    with pytest.raises(SceneError, match="no scene file"):
        job.check()
