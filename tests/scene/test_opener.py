"""A scene, and the renderer that reads it."""

import pytest

from enfilade.device import active
from enfilade.errors import SceneError, SettingsError
from enfilade.renderer import why_inseparable
from enfilade.scene.opener import Scene
from enfilade.settings import LimitSettings, Settings
from support.analytic import AnalyticRenderer
from support.analytic_scene import write_scene
from support.example_scenes import ball, wall

BALL = '<shape type="sphere" id="ball"/><emitter type="constant"/>'
RENDERER = "support.analytic:load"


def test_mitsuba_reads_xml(scene):
    of = Scene(scene(BALL))
    of.check(LimitSettings())
    renderer, identity = of.open(Settings()), of.identity()
    facts = renderer.describe()
    assert facts.shapes == ("ball",)
    assert why_inseparable(renderer) == ""
    assert (identity["renderer"], identity["variant"]) == (facts.renderer, active().variant)
    assert len(identity["fingerprint"]) == 64
    assert Scene.from_json(of.to_json()) == of


def test_a_scene_that_mitsuba_loads_and_does_not_render(scene):
    hot = '<spectrum name="intensity" type="blackbody"><float name="temperature" value="4000"/></spectrum>'
    bump = '<bsdf type="bumpmap"><texture type="checkerboard"/><bsdf type="diffuse"/></bsdf>'
    for more in (f'<emitter type="point">{hot}</emitter>', f'<shape type="cube">{bump}</shape>'):
        with pytest.raises(SceneError, match=r"can't render .*scene.xml: .*[Nn]ot implemented"):
            Scene(scene(BALL + more)).open(Settings())


def test_a_renderer_of_your_own(tmp_path):
    of = Scene(write_scene(tmp_path / "ball", ball()), RENDERER)
    of.check(LimitSettings())
    renderer = of.open(Settings())
    assert isinstance(renderer, AnalyticRenderer)
    assert "'analytic' does not separate lobes" in why_inseparable(renderer)
    before = of.identity()
    assert before["renderer"] == RENDERER
    write_scene(of.file, wall())
    assert of.identity()["fingerprint"] != before["fingerprint"]
    of.file.unlink()
    for refused in (lambda: of.check(LimitSettings()), of.identity):
        with pytest.raises(SceneError, match="scene"):
            refused()


@pytest.mark.parametrize("name", ["gone:load", "support.analytic:gone", "support.analytic"])
def test_a_renderer_that_does_not_exist(scene, name):
    with pytest.raises(SettingsError, match=r"there is no renderer .*module:function"):
        Scene(scene(BALL), name).check(LimitSettings())


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("room.blend", "import it by `enfilade import`"),
        ("walk.json", "a camera path is given by --path"),
        ("room", r"is not a scene in Mitsuba's XML format \(\.xml\)$"),
    ],
)
def test_other_files_are_refused_with_advice(tmp_path, name, words):
    of = Scene(tmp_path / name)
    for refused in (lambda: of.check(LimitSettings()), lambda: of.open(Settings()), of.identity):
        with pytest.raises(SceneError, match=words):
            refused()
