"""The frames of a run encoded once more."""

from __future__ import annotations

import json

import numpy as np
import pytest

from enfilade.errors import DamagedFileError, RunFolderError, SettingsError, UnfinishedError
from enfilade.images import open_sequence, read_exr
from enfilade.monitor import Silence
from enfilade.runs.encode import encode
from enfilade.runs.render import prepare, render
from support.toys import Recorder, flip, toy_job
from support.views import write_config

TABLES = {"video": {"codec": "ffv1"}, "viewing": {"exposure_ev": -1.0}}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A finished run of four frames, a stop darker."""
    folder = tmp_path_factory.mktemp("encoded")
    render(toy_job(folder, **TABLES), folder / "run", Silence())
    return folder / "run"


@pytest.fixture
def own(tmp_path):
    """The same run, to be damaged."""
    render(toy_job(tmp_path, **TABLES), tmp_path / "run", Silence())
    return tmp_path / "run"


def images(file):
    return np.stack(list(open_sequence(file)))


def frames(run):
    return np.stack([read_exr(file)["RGB"].astype(float) for file in sorted((run / "frames").glob("*.exr"))])


def test_the_settings_are_those_of_the_run(run, tmp_path):
    monitor = Recorder()
    file = encode(run, {}, monitor, file=tmp_path / "again.mkv")
    np.testing.assert_array_equal(images(file), images(run / "video.mkv"))
    assert (open_sequence(file).fps, monitor.counts) == (24.0, {"video": 4})


def test_another_exposure_and_codec(run):
    before = {file: file.read_bytes() for file in run.iterdir() if file.is_file()}
    changes = {"video": {"codec": "prores"}, "viewing": {"exposure_ev": 0.0, "diagonal_m": 1.0}}
    file = encode(run, changes, Silence())
    assert file == run / "encoded.mov"
    assert abs(images(file) - np.clip(frames(run), 0.0, 1.0)).mean() < 0.01
    file.unlink()
    assert {file: file.read_bytes() for file in run.iterdir() if file.is_file()} == before


@pytest.mark.parametrize(
    ("name", "is_replaced", "error", "words"),
    [
        ("video.mkv", True, RunFolderError, "the run's own"),
        ("clips/0001.mkv", True, RunFolderError, "the run's own"),
        ("clips/0241.mkv", False, RunFolderError, "the run's own"),
        ("there.mkv", False, RunFolderError, "there already; choose another --out, or add --overwrite"),
        ("there.mkv", True, None, ""),
        ("a.mp4", False, SettingsError, r"end in \.mkv"),
    ],
)
def test_no_file_is_replaced_by_accident(run, name, is_replaced, error, words):
    (run / "there.mkv").write_text("mine")
    own = (run / "video.mkv").read_bytes()
    if error is None:
        encode(run, {}, Silence(), file=run / name, is_replaced=is_replaced)
        assert len(open_sequence(run / name)) == 4
    else:
        with pytest.raises(error, match=words):
            encode(run, {}, Silence(), file=run / name, is_replaced=is_replaced)
        assert (run / "there.mkv").read_text() == "mine"
    assert (run / "video.mkv").read_bytes() == own
    (run / "there.mkv").unlink()


def test_missing_frames_are_named_or_left_out(own, tmp_path):
    prepare(toy_job(tmp_path), tmp_path / "begun")
    with pytest.raises(UnfinishedError, match=r"0 of 4 frames, 1-4 are missing; `enfilade work .*` renders"):
        encode(tmp_path / "begun", {}, Silence(), is_partial=True)
    (own / "frames" / "0002.exr").unlink()
    with pytest.raises(UnfinishedError, match=r"3 of 4 frames, 2 are missing.* --unfinished") as error:
        encode(own, {}, Silence())
    assert error.value.tasks == ("frames 2",)
    assert len(open_sequence(encode(own, {}, Silence(), is_partial=True))) == 3


def test_a_damaged_frame_is_not_encoded(own):
    flip(own / "frames" / "0003.exr")
    with pytest.raises(DamagedFileError, match=r"0003\.exr"):
        encode(own, {}, Silence())
    assert not list(own.glob("*encoded*"))


@pytest.fixture
def with_look(own):
    """The run with a view and a look that its configuration does not have."""
    table = json.loads((own / "job.json").read_text())
    view = {"view": "AgX", "look": "Punchy", "display": "sRGB"}
    table["settings"]["video"] |= {"ocio": write_config(own), **view}
    (own / "job.json").write_text(json.dumps(table))
    return own


def test_another_view_drops_the_look_of_the_run(with_look):
    pytest.importorskip("PyOpenColorIO")
    assert len(images(encode(with_look, {"video": {"view": "Soft"}}, Silence()))) == 4
    with pytest.raises(SettingsError, match="no look 'Punchy'"):
        encode(with_look, {"video": {"view": "Soft", "look": "Punchy"}}, Silence())


def test_another_configuration_drops_the_view_of_the_run(run, with_look):
    shown = images(encode(with_look, {"video": {"ocio": ""}}, Silence()))
    np.testing.assert_array_equal(shown, images(run / "video.mkv"))
    with pytest.raises(SettingsError, match="view"):
        encode(run, {"video": {"view": "Film"}}, Silence())
    pytest.importorskip("PyOpenColorIO")
    with pytest.raises(SettingsError, match=r"missing\.ocio"):
        encode(run, {"video": {"ocio": str(run / "missing.ocio")}}, Silence())
