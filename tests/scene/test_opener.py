"""Renderers by the name of the scene, or by an import path."""

import pytest

from enfilade.errors import SceneError, SettingsError
from enfilade.renderer import why_inseparable
from enfilade.scene.opener import check_scene, identify_scene, open_renderer
from enfilade.settings import LimitSettings, TraceSettings
from scenes_analytic import ball, wall
from small_runs import RENDERER
from support.analytic import AnalyticRenderer
from support.analytic_scene import write_scene

BALL = '<shape type="sphere" id="ball"/><emitter type="constant"/>'


def test_mitsuba_reads_xml(scene):
    file = scene(BALL)
    check_scene(file, LimitSettings())
    renderer, identity = open_renderer(file, TraceSettings()), identify_scene(file)
    assert renderer.describe().shapes == ("ball",)
    assert why_inseparable(renderer) == ""
    assert (identity.renderer, identity.variant) == (
        renderer.describe().renderer,
        renderer.describe().variant,
    )
    assert len(identity.fingerprint) == 64


def test_a_renderer_of_your_own(tmp_path):
    file = write_scene(tmp_path / "ball", ball())
    check_scene(file, LimitSettings(), RENDERER)
    renderer = open_renderer(file, TraceSettings(), RENDERER)
    assert isinstance(renderer, AnalyticRenderer)
    assert "'analytic' does not estimate lobes apart" in why_inseparable(renderer)
    identity = identify_scene(file, RENDERER)
    assert identity.renderer == RENDERER
    write_scene(file, wall())
    assert identify_scene(file, RENDERER).fingerprint != identity.fingerprint
    file.unlink()
    for refused in (
        lambda: check_scene(file, LimitSettings(), RENDERER),
        lambda: identify_scene(file, RENDERER),
    ):
        with pytest.raises(SceneError, match="scene"):
            refused()


@pytest.mark.parametrize("name", ["gone:load", "support.analytic:gone", "support.analytic", ""])
def test_a_renderer_that_does_not_exist(scene, name):
    with pytest.raises(SettingsError, match=r"there is no renderer .*module:function"):
        check_scene(scene(BALL), LimitSettings(), name)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("room.blend", "mitsuba-blender add-on .*docs/camera-paths"),
        ("walk.json", "a camera path is given by --path"),
        ("room", r"is not a scene in Mitsuba's XML format \(\.xml\)$"),
    ],
)
def test_other_files_are_refused_with_advice(tmp_path, name, words):
    for refused in (
        lambda: check_scene(tmp_path / name, LimitSettings()),
        lambda: open_renderer(tmp_path / name, TraceSettings()),
        lambda: identify_scene(tmp_path / name),
    ):
        with pytest.raises(SceneError, match=words):
            refused()
