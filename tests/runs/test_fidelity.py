"""Cycles' frames and those of the imported scene are compared object by object."""

import json

import numpy as np
import pytest

import enfilade
from enfilade.camera import load_path
from enfilade.errors import SceneError
from enfilade.images import read_exr, write_exr
from enfilade.monitor import Silence
from enfilade.reports.fidelity import differences_of
from enfilade.runs.fidelity import check_import, checked_numbers
from enfilade.scene.blender.find import find_blender
from enfilade.scene.blender.source import Choices
from enfilade.settings import LimitSettings
from support.fake_blender import write_program
from support.toys import slide

SIZE = (32, 24)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fidelity")


@pytest.fixture(scope="module")
def program(folder):
    return str(write_program(folder / "blender"))


def written(folder, gain=(1.0, 1.0, 1.0)):
    """Frames 11 and 13, of our own reference, as Cycles' with two seeds, and a file that names them."""
    scene, path = folder / "scene" / "scene.xml", folder / "scene" / "camera_path.json"
    for seed in (0, 1):
        run = folder / f"run-{seed}"
        settings = {
            "sampling": {"spp": 16},
            "trace": {"seed": 8 + seed},
            "reference": {"pixel_filter": "box"},
        }
        if not run.exists():
            enfilade.render(
                scene, load_path(path, frames=(11, 13)), run, method="reference", settings=settings
            )
        for number in (11, 13):
            image = read_exr(run / "frames" / f"{number:04d}.exr")["RGB"].astype(np.float32)
            write_exr(folder / "cycles" / str(seed) / f"{number}.exr", {"RGB": image * np.float32(gain)})
    source = folder / "shot.blend"
    source.write_text(json.dumps({"size": SIZE, "cycles": str(folder / "cycles")}))
    return source


@pytest.fixture(scope="module")
def imported(folder, program):
    source = folder / "first.blend"
    source.write_text(json.dumps({"size": SIZE}))
    return enfilade.import_scene(source, folder / "scene", settings={"blender": {"program": program}})


def checked(imported, source, program, **terms):
    blender = find_blender(program)
    return check_import(imported, source, blender, Choices(), LimitSettings(), Silence(), **terms)


def test_objects_that_differ_are_found(imported, folder, program):
    same = checked(imported, written(folder), program, numbers=(11, 13), spp=32)
    assert [of.number for of in same.frames] == [11, 13]
    assert (same.names, same.spp) == (("ball",), 32)
    everything, ball = differences_of(same)
    assert (ball.name, ball.shape_index) == ("ball", 1)
    assert 5.0 < ball.pixel_percent < 60.0
    assert ball.color_percent < max(2.0 * ball.noise_percent, 0.5)
    assert everything.color_percent < max(2.0 * everything.noise_percent, 0.5)
    redder = checked(imported, written(folder, (0.8, 1.0, 1.0)), program, numbers=(11, 13), spp=32)
    assert differences_of(redder)[1].color_percent == pytest.approx(100 * 0.2 / 0.9575 / 3, rel=0.2)


@pytest.mark.parametrize(("frames", "numbers"), [(2, (1, 2)), (3, (1, 2, 3)), (9, (1, 5, 9))])
def test_frames_are_chosen_evenly(frames, numbers):
    assert checked_numbers(slide(frames)) == numbers


def test_a_frame_that_is_missing(imported, folder, program, monkeypatch):
    source = written(folder)
    (folder / "cycles" / "1" / "13.exr").unlink()
    with pytest.raises(SceneError, match="without a result"):
        checked(imported, source, program, numbers=(11, 13), spp=4)
