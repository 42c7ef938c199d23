"""Shadow rays through thin glass and cut-outs: with Mitsuba's `path`, too, to emitters that paths can hit."""

import drjit as dr
import numpy as np
import pytest

from enfilade.arrays import Array3f, rows
from enfilade.kernels.random import one_sequence
from enfilade.renderer import Rays
from enfilade.scene.mitsuba import transport
from support.mitsuba_scene import DIFFUSE, opened, placed, rgb, veil, write

COUNT = 1 << 14
INTEGRATOR = '<scene version="3.0.0"><integrator type="{}"/>'
GLASS = '<bsdf type="thindielectric"><float name="int_ior" value="1.5"/></bsdf>'
PASSED = {"thin glass": (GLASS, 0.923), "cut-out": (veil(0.3), 0.7)}  # share along the normal
LAMP = placed(
    "rectangle", "lamp", (0, 0, -4), f'<emitter type="area">{rgb("radiance", 5, 5, 5)}</emitter>', 0.2
)
POINT = (
    f'<emitter type="point"><point name="position" x="0" y="0" z="-4"/>{rgb("intensity", 1, 1, 1)}</emitter>'
)
FLOOR = (
    '<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="180"/></transform>'
    f"{DIFFUSE}</shape>"
)


def pane(bsdf, *, is_instance):
    if not is_instance:
        return placed("rectangle", "pane", (0, 0, -2), bsdf, 1.0)
    disk = placed("disk", "pane", (0, 0, -2), bsdf, 1.0)  # instances of meshes are expanded
    group = f'<shape type="shapegroup" id="group">{disk}</shape>'
    return f'{group}<shape type="instance"><ref id="group"/></shape>'


def direct(folder, *shapes, integrator="path"):
    """Light of next-event estimation at the middle of a floor that faces a lamp."""
    scene = write(folder, FLOOR, *shapes, head=INTEGRATOR.format(integrator), sky="")
    renderer = opened(scene)
    rays = Rays(*(Array3f(*of) + dr.zeros(Array3f, COUNT) for of in ((0.0, 0.0, -0.5), (0.0, 0.0, 1.0))))
    point, sampler = renderer.intersect(rays), one_sequence(COUNT)
    found = renderer.sample_diffuse(point, sampler, soft_only=renderer.has_sharp_light()).direct
    if renderer.has_sharp_light():
        found = found + renderer.sharp_light(point, sampler).diffuse
    return rows(found).mean(dtype=float)


@pytest.mark.parametrize("is_instance", [False, True])
@pytest.mark.parametrize("name", PASSED)
@pytest.mark.parametrize("integrator", ["path", "volpath"])
def test_light_passes(tmp_path, integrator, name, is_instance):
    bsdf, share = PASSED[name]
    bare = direct(tmp_path, LAMP, integrator=integrator)
    found = direct(tmp_path, LAMP, pane(bsdf, is_instance=is_instance), integrator=integrator)
    assert found == pytest.approx(share * bare, rel=0.01)


@pytest.mark.parametrize("is_instance", [False, True])
def test_opaque_surfaces_block_it(tmp_path, is_instance):
    glass = placed("rectangle", "glass", (0, 0, -1), GLASS, 1.0)
    assert direct(tmp_path, LAMP, glass) > 0.0
    assert direct(tmp_path, LAMP, glass, pane(DIFFUSE, is_instance=is_instance)) == 0.0


@pytest.mark.parametrize(("integrator", "share"), [("path", 0.0), ("volpath", 0.923)])
def test_light_that_no_path_can_hit_passes_as_in_mitsuba(tmp_path, integrator, share):
    bare = direct(tmp_path, POINT, integrator=integrator)
    found = direct(tmp_path, POINT, pane(GLASS, is_instance=False), integrator=integrator)
    assert bare > 0.0
    assert found == pytest.approx(share * bare, rel=0.01)


@pytest.mark.parametrize(("name", "is_passed"), [("thin glass", True), ("below a normal map", False)])
def test_a_path_keeps_its_bounce_where_shadow_rays_pass(tmp_path, name, is_passed):
    """Mitsuba's maps transmit no shadow rays: emission behind them counts in full."""
    bsdf = GLASS if is_passed else f'<bsdf type="normalmap">{rgb("normalmap", 0.5, 0.5, 1)}{GLASS}</bsdf>'
    scene = write(
        tmp_path, FLOOR, LAMP, pane(bsdf, is_instance=False), head=INTEGRATOR.format("path"), sky=""
    )
    renderer = opened(scene)
    rays = Rays(*(Array3f(*of) + dr.zeros(Array3f, COUNT) for of in ((0.0, 0.0, -0.5), (0.0, 0.0, 1.0))))
    point, sampler = renderer.intersect(rays), one_sequence(COUNT)
    sample = renderer.sample_diffuse(point, sampler)
    direct, throughput = sample.direct, dr.select(sample.is_alive, sample.throughput, 0.0)
    ahead = renderer.intersect(sample.rays, sample.bounce, sample.is_alive)
    beyond = renderer.sample_specular(ahead, sampler)
    throughput = dr.select(beyond.is_alive, throughput * beyond.throughput, 0.0)
    emission = renderer.intersect(beyond.rays, beyond.bounce, beyond.is_alive).emission
    found = rows(direct + throughput * emission).mean(axis=0, dtype=float)
    whole = rows(sum(renderer.estimate_diffuse(point, sampler))).mean(axis=0, dtype=float)
    assert dr.any(beyond.is_passed) == is_passed
    assert np.any(rows(direct)) == is_passed
    assert found == pytest.approx(whole, rel=0.1)


@pytest.mark.parametrize("integrator", ["path", "volpath"])
def test_a_lamp_behind_glass_counts_once(tmp_path, integrator):
    """Its light is direct, also where a path meets nothing else; behind tinted glass with `volpath`."""
    tint = rgb("specular_transmittance", 1, 0.5, 0.1) if integrator == "volpath" else ""
    glass = f'<bsdf type="thindielectric">{tint}{rgb("specular_reflectance", 0, 0, 0)}</bsdf>'
    shape = LAMP.replace("<emitter", '<bsdf type="null"/><emitter')
    head = INTEGRATOR.format(integrator)
    renderer = opened(write(tmp_path, FLOOR, shape, pane(glass, is_instance=False), head=head, sky=""))
    rays = Rays(*(Array3f(*of) + dr.zeros(Array3f, COUNT) for of in ((0.0, 0.0, -0.5), (0.0, 0.0, 1.0))))
    direct, indirect = renderer.estimate_diffuse(renderer.intersect(rays), one_sequence(COUNT))
    direct, indirect = (rows(of).mean(axis=0, dtype=float) for of in (direct, indirect))
    assert np.all(direct > 0.0)
    assert np.abs(indirect) == pytest.approx(0.0, abs=0.1 * direct.max())


@pytest.mark.parametrize(("opacity", "count"), [(0.5, 1), (0.0, 8)])
def test_a_small_lamp_behind_cut_outs_leaves_no_noise_in_the_rest(tmp_path, opacity, count):
    """A path passes half of the cut-out by chance; Russian roulette may end it behind five."""
    area = f'<emitter type="area">{rgb("radiance", 1e5, 1e5, 1e5)}</emitter>'
    lamp = placed("rectangle", "lamp", (0, 0, -4), area, 0.02)
    panes = [placed("rectangle", f"pane {k}", (0, 0, -2 - 0.1 * k), veil(opacity), 1.0) for k in range(count)]
    renderer = opened(write(tmp_path, FLOOR, lamp, *panes, head=INTEGRATOR.format("path"), sky=""))
    lanes = 1 << 18  # of which ten meet the lamp
    rays = Rays(*(Array3f(*of) + dr.zeros(Array3f, lanes) for of in ((0.0, 0.0, -0.5), (0.0, 0.0, 1.0))))
    direct, indirect = (
        rows(of) for of in renderer.estimate_diffuse(renderer.intersect(rays), one_sequence(lanes))
    )
    assert np.abs(indirect).max() < 10.0 * direct.mean()


def test_light_that_a_reflector_returns_through_its_lamp_is_kept(tmp_path, monkeypatch):
    """Rays pass the lamp with certainty: what they find behind it has no noise of its emission."""
    ball = '<float name="radius" value="0.05"/><point name="center" x="0" y="0" z="-2"/><ref id="lamp"/>'
    area = f'<emitter type="area">{rgb("radiance", 100, 100, 100)}</emitter>'
    bulb = f'<bsdf type="null" id="lamp"/><shape type="sphere">{ball}{area}</shape>'
    behind = placed("disk", "reflector", (0, 0, -2.1), DIFFUSE, 0.15)
    renderer = opened(write(tmp_path, FLOOR, bulb, behind, head=INTEGRATOR.format("path"), sky=""))
    lanes = 1 << 18
    rays = Rays(*(Array3f(*of) + dr.zeros(Array3f, lanes) for of in ((0.0, 0.0, -0.5), (0.0, 0.0, 1.0))))

    def indirect():
        point = renderer.intersect(rays)
        return rows(renderer.estimate_diffuse(point, one_sequence(lanes))[1]).mean(dtype=float)

    found = indirect()
    monkeypatch.setattr(transport, "RARE_WEIGHT", 0.0)
    assert found == pytest.approx(indirect(), rel=0.01)
    assert found > 0.0
