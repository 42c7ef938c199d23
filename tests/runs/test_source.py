"""A file that Blender imports is the scene of a run, from Python too."""

import json

import pytest

import enfilade
from enfilade.errors import CameraPathError, RunFolderError, SceneError
from enfilade.monitor import Silence
from enfilade.runs.job import read_job
from enfilade.runs.lock import Lock
from enfilade.runs.source import imported_scene
from enfilade.settings import Settings, ViewingSettings
from support.fake_blender import NOTE, write_program


@pytest.fixture
def tables(tmp_path):
    """Settings of a quick run, with a program that stands for Blender."""
    program = str(write_program(tmp_path / "blender"))
    return {"blender": {"program": program}, "sampling": {"spp": 2}}


@pytest.fixture
def shot(tmp_path):
    def write(**wish):
        file = tmp_path / "shot.blend"
        file.write_text(json.dumps({"size": [16, 12], **wish}))
        return file

    return write


def test_render_from_python(shot, tables, tmp_path):
    source, out = shot(), tmp_path / "run"
    for _ in range(2):
        summary = enfilade.render(source, None, out, method="reference", settings=tables)
    assert summary["frames"] == 3
    assert len(source.with_suffix(".calls").read_text().splitlines()) == 1
    job = read_job(out)
    assert job.path.numbers == (11, 12, 13)
    assert job.settings[ViewingSettings].exposure_ev == 0.5


def test_complete_settings_replace_those_of_the_file(shot, tables, tmp_path):
    settings = Settings.from_tables(tables)
    enfilade.render(shot(), None, tmp_path / "run", method="reference", settings=settings)
    assert read_job(tmp_path / "run").settings[ViewingSettings].exposure_ev == 0.0


def test_import_from_python(shot, tables, tmp_path):
    settings = {"blender": {**tables["blender"], "camera": "B"}}
    notes = [{"kind": "not-carried", **NOTE}]
    made = enfilade.import_scene(shot(notes=notes), tmp_path / "scene", settings=settings, frames=(1, 2))
    assert (made.camera, made.frames, made.notes[0].effect) == ("B", (1, 2), "the sofa is plain")
    strict = {"blender": {**settings["blender"], "strict": True}}
    with pytest.raises(SceneError, match="Sofa / Noise Texture"):
        enfilade.import_scene(shot(notes=notes), tmp_path / "other", settings=strict)
    with pytest.raises(CameraPathError, match="no camera"):
        enfilade.render(shot(camera=""), None, tmp_path / "run", settings=tables)
    with pytest.raises(CameraPathError, match="needs a camera path"):
        enfilade.render(made.scene_file, None, tmp_path / "run", settings=tables)


def imported(source, run, tables):
    return imported_scene(source, run, Settings.from_tables(tables), Silence())


def test_two_commands_do_not_import_into_one_folder(shot, tables, tmp_path):
    run = tmp_path / "run"
    run.mkdir()
    lock = Lock(run)
    with pytest.raises(RunFolderError, match="another command is writing"):
        imported(shot(), run, tables)
    lock.release()
    assert imported(shot(), run, tables).folder == run / "scene"


def test_before_the_run_begins_a_changed_file_is_imported_again(shot, tables, tmp_path):
    run = tmp_path / "run"
    assert imported(shot(), run, tables).fps == 24.0
    source = shot(fps=25.0)
    assert imported(source, run, tables).fps == 25.0
    assert imported(source, run, tables).fps == 25.0
    assert len(source.with_suffix(".calls").read_text().splitlines()) == 2
    for name in ("run.json", "ledger.jsonl"):
        (run / name).touch()
        with pytest.raises(RunFolderError, match="has changed since it was imported"):
            imported(shot(), run, tables)
        (run / name).unlink()


@pytest.mark.parametrize("name", ["run.json", "ledger.jsonl"])
def test_nothing_is_imported_into_another_run(shot, tables, tmp_path, name):
    run, source = tmp_path / "run", shot()
    run.mkdir()
    (run / name).touch()
    with pytest.raises(RunFolderError, match="a run whose scene was not imported"):
        imported(source, run, tables)
    assert [file.name for file in run.iterdir()] == [name]
    assert not source.with_suffix(".calls").exists()


def test_wrong_files_leave_no_folder(tables, tmp_path):
    with pytest.raises(SceneError, match="there is no file"):
        imported(tmp_path / "gone.blend", tmp_path / "run", tables)
    assert not (tmp_path / "run").exists()


def test_a_lost_file_is_an_error_that_says_how_to_continue(shot, tables, tmp_path):
    run, source = tmp_path / "my run", shot()
    imported(source, run, tables)
    source.unlink()
    with pytest.raises(SceneError, match=r"`enfilade render '.*/my run/scene' --out '.*/my run'` continues"):
        imported(source, run, tables)
    (run / "ledger.jsonl").touch()
    with pytest.raises(SceneError, match=r"`enfilade work '.*/my run'` continues"):
        imported(source, run, tables)


def test_a_failed_import_does_not_spoil_the_folder(shot, tables, tmp_path):
    run = tmp_path / "run"
    with pytest.raises(SceneError):
        imported(shot(do="crash"), run, tables)
    assert not (run / "scene").exists()
    assert imported(shot(), run, tables).camera == "Cam"
