"""Integrators of Mitsuba scenes: which are accepted, and whose lobes are separable."""

import drjit as dr
import numpy as np
import pytest

from enfilade.arrays import Array3f, rows
from enfilade.camera.pinhole import Camera, look_at
from enfilade.errors import SceneError
from enfilade.gbuffer import find_geometry
from enfilade.renderer import Purpose, RandomKey, Rays
from support.mitsuba_scene import DIFFUSE, HOLES, opened, placed, veil, write_holes

HIDDEN = '<integrator type="{}"><boolean name="hide_emitters" value="true"/></integrator>'
AOVS = '<integrator type="aov"><string name="aovs" value="d:depth"/><integrator type="path"/></integrator>'
SPOT = '<emitter type="spot"/>'
THREE = '<integer name="max_depth" value="3"/>'
BUMPS = HOLES.format("bumps", "bilinear")
FOG = '<medium type="homogeneous" name="interior"/>'


def of_integrator(folder, integrator, inside=DIFFUSE):
    file = folder / "scene.xml"
    file.write_text(
        f'<scene version="3.0.0">{integrator}{placed("sphere", "ball", (0, 0, 0), inside)}'
        f'<emitter type="constant"/></scene>'
    )
    return file


@pytest.mark.parametrize(
    ("integrator", "inside", "words"),
    [
        ('<integrator type="path"/>', DIFFUSE, ""),
        ('<integrator type="volpath"/>', DIFFUSE, ""),
        ("", DIFFUSE, ""),
        ('<integrator type="direct"/>', DIFFUSE, "DirectIntegrator, not a path tracer"),
        (f'<integrator type="path">{THREE}</integrator>', DIFFUSE, "depth 3 (--max-depth 5 or"),
        (HIDDEN.format("path"), DIFFUSE, ""),
        (AOVS, DIFFUSE, ""),
        (f'<integrator type="moment">{HIDDEN.format("path")}</integrator>', DIFFUSE, ""),
        ('<integrator type="moment"><integrator type="direct"/></integrator>', DIFFUSE, "DirectIntegrator"),
        ('<integrator type="volpath"/>', f'<bsdf type="null"/>{FOG}', "participating media"),
        ('<integrator type="path"/>', f'<bsdf type="dielectric"/>{FOG}', ""),  # which it never looks at
        ('<integrator type="volpath"/>', '<bsdf type="thindielectric"/>', ""),
        (f'<integrator type="volpath"/>{SPOT}', DIFFUSE, ""),
        (f'<integrator type="volpath"/>{SPOT}', '<bsdf type="thindielectric"/>', ""),
        (f'<integrator type="path"/>{SPOT}', '<bsdf type="thindielectric"/>', ""),
        ("", f'<bsdf type="mask"><bsdf type="bumpmap">{BUMPS}{DIFFUSE}</bsdf></bsdf>', ""),
        ("", f'<bsdf type="bumpmap">{BUMPS}<bsdf type="mask">{DIFFUSE}</bsdf></bsdf>', "contains a cut-out"),
    ],
)  # fmt: skip
def test_why_lobes_are_inseparable(tmp_path, integrator, inside, words):
    write_holes(tmp_path)
    why = opened(of_integrator(tmp_path, integrator, inside)).why_inseparable()
    assert (words in why) if words else (why == "")


@pytest.mark.parametrize("opacity", [1.0, 0.6])
def test_a_mask_is_as_diffuse_as_it_is_opaque(tmp_path, opacity):
    """An opaque mask has no specular lobes to sample."""
    renderer = opened(of_integrator(tmp_path, "", f'<bsdf type="twosided">{DIFFUSE}</bsdf>'))
    leaf = opened(of_integrator(tmp_path, "", veil(opacity)))
    rays = Rays(Array3f(0, 0, 6), Array3f(0, 0, -1))
    whole, pierced = renderer.intersect(rays), leaf.intersect(rays)
    np.testing.assert_allclose(
        rows(pierced.surfaces.albedo), opacity * rows(whole.surfaces.albedo), rtol=1e-5
    )
    assert not whole.has_specular[0]
    assert pierced.has_specular[0] == (opacity < 1.0)


@pytest.mark.parametrize(
    ("bsdf", "least", "most"),
    [
        (DIFFUSE, 0.0, 0.0),
        ('<bsdf type="conductor"><rgb name="specular_reflectance" value="0.5"/></bsdf>', 0.499, 0.501),
        ('<bsdf type="thindielectric"/>', 0.999, 1.001),
        ('<bsdf type="roughplastic"/>', 0.03, 0.06),  # 4 % at normal incidence
        ('<bsdf type="principled"><float name="metallic" value="1"/></bsdf>', 0.3, 0.6),  # its base is 0.5
    ],
)
def test_specular_albedo_tells_how_much_the_specular_lobes_scatter(tmp_path, bsdf, least, most):
    renderer = opened(of_integrator(tmp_path, "", bsdf))
    point = renderer.intersect(Rays(Array3f(0, 0, 6), Array3f(0, 0, -1)))
    assert least <= point.specular_albedo[0] <= most


def test_properties_that_mitsuba_does_not_know_are_named(tmp_path):
    unknown = (
        '<integrator type="direct"><integer name="a" value="8"/><integer name="b" value="9"/></integrator>'
    )
    with pytest.raises(SceneError, match=r'2 unreferenced .* type "direct": integer "a": 8, integer "b": 9$'):
        opened(of_integrator(tmp_path, unknown))


def test_a_limit_of_edges_leaves_the_integrator_what_it_is(tmp_path):
    integrator = opened(of_integrator(tmp_path, HIDDEN.format("volpath")), max_depth=7)._integrator
    assert integrator.class_name() == "VolumetricPathIntegrator"
    assert "max_depth = 7" in str(integrator)
    assert "max_depth = 6" in str(opened(of_integrator(tmp_path, AOVS), max_depth=6)._integrator)
    direct = of_integrator(tmp_path, '<integrator type="direct"/>')
    with pytest.raises(SceneError, match="DirectIntegrator, has no limit of the path depth: leave --max"):
        opened(direct, max_depth=7)
    for name in ("ptracer", "prb", "prbvolpath"):
        with pytest.raises(SceneError, match="can't render single pixels"):
            opened(of_integrator(tmp_path, f'<integrator type="{name}"/>'))


def test_hidden_emitters_are_not_seen_and_give_light(tmp_path):
    """A lamp before a wall, a mirror before the sky, and the sky."""
    glow = '<bsdf type="diffuse"/><emitter type="area"><rgb name="radiance" value="9"/></emitter>'
    shapes = placed("rectangle", "lamp", (0, 0, 2), glow) + placed("rectangle", "wall", (0, 0, 0), DIFFUSE)
    shapes += placed("rectangle", "mirror", (3, 0, 0), '<bsdf type="conductor"/>')
    sky = '<emitter type="constant"><rgb name="radiance" value="0.5"/></emitter>'
    cameras = [Camera(look_at((x, 0, 6), (x, 0, 0)), 0.5, 4, 4) for x in (0, 3, 6)]
    pixels = np.arange(16, dtype=np.uint32)

    def found(integrator):
        file = tmp_path / "scene.xml"
        file.write_text(f'<scene version="3.0.0">{integrator}{shapes}{sky}</scene>')
        renderer, key = opened(file), RandomKey(1, 0, Purpose.REFERENCE)
        names = ("", *renderer.describe().shapes)
        seen = {names[index] for c in cameras for index in find_geometry(renderer, c).shape_index.flat}
        traced = [renderer.trace(camera, pixels, key, spp=64).color.mean() for camera in cameras]
        rays = Rays(Array3f([0, 3, 6], 0, 6), Array3f(0, 0, -1) + dr.zeros(Array3f, 3))
        emitted = rows(renderer.intersect(rays).emission).mean(axis=1)
        return renderer.describe().has_background, seen, traced, emitted.tolist()

    has_background, seen, traced, emitted = found('<integrator type="path"/>')
    assert (has_background, seen) == (True, {"lamp", "mirror", ""})
    assert traced == pytest.approx([9.25, 0.48, 0.5], abs=0.03)
    assert emitted == pytest.approx([9.0, 0.0, 0.5])
    has_background, seen, traced, emitted = found(HIDDEN.format("path"))
    assert (has_background, seen) == (False, {"wall", "mirror", ""})
    assert 0.05 < traced[0] < 1.0  # of the wall, lit by the lamp
    assert traced[1:] == pytest.approx([0.48, 0.0], abs=0.03)
    assert emitted == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("{0}", ""),
        (
            '<shape type="sphere"><transform name="to_world"><translate x="20000"/></transform></shape>',
            "1.8 units",
        ),
        ('<shape type="sphere"><float name="radius" value="0.01"/></shape>', "measures 0.0346: shadows"),
        ('<shape type="sphere"><bsdf type="polarizer"/></shape>', "no polarization here"),
        (
            '<integrator type="volpath"/>{0}<sensor type="perspective"><medium type="homogeneous"/></sensor>',
            "taken to be in",
        ),
    ],
)
def test_limitations_are_noted(tmp_path, body, words):
    file = tmp_path / "scene.xml"
    inside = body.format(placed("sphere", "ball", (0, 0, 0), DIFFUSE))
    file.write_text(f'<scene version="3.0.0">{inside}<emitter type="constant"/></scene>')
    notes = opened(file).describe().notes
    assert (words in " ".join(notes)) if words else notes == ()
