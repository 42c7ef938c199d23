"""Both branches of rough interfaces: reflection and transmission together are what one random choice is."""

import drjit as dr
import numpy as np
import pytest

from enfilade.arrays import Array3f, Bool, UInt, rows, vector3
from enfilade.kernels.random import one_sequence
from enfilade.renderer import Branch, Rays
from support.mitsuba_scene import HOLES, opened, placed, rgb, write, write_holes

COUNT = 1 << 17
GLASS = '<float name="spec_trans" value="1"/><float name="roughness" value="0.4"/>'
INTERFACES = {
    "rough dielectric": '<bsdf type="roughdielectric"><float name="alpha" value="0.3"/></bsdf>',
    "principled": f'<bsdf type="principled">{GLASS}<float name="eta" value="1.5"/></bsdf>',
    "of a given specular": f'<bsdf type="principled">{GLASS}<float name="specular" value="0.8"/></bsdf>',
}
# Glass under a bump map, whose slopes reflect no light totally at the angles below.
BUMPY = (
    f'<bsdf type="bumpmap">{HOLES.format("bump", "bilinear")}<float name="scale" value="0.002"/>'
    '<bsdf type="{}"/></bsdf>'
)
CLEAR = {
    "glass": '<bsdf type="dielectric"/>',
    "bumpy glass": BUMPY.format("dielectric"),
    "bumpy pane": BUMPY.format("thindielectric"),
}
OTHERS = {
    "partly transmitting": '<bsdf type="principled"><float name="spec_trans" value="0.5"/></bsdf>',
    "metallic": f'<bsdf type="principled">{GLASS}<float name="metallic" value="0.5"/></bsdf>',
    "rough metal": '<bsdf type="roughconductor"/>',
}


PATCHES = INTERFACES | CLEAR | OTHERS
SIZE = 0.1


@pytest.fixture(scope="module")
def renderer(tmp_path_factory):
    """Patches of a plane in a row, one a material, under a lamp that shadow rays find."""
    folder = tmp_path_factory.mktemp("patches")
    write_holes(folder)
    emitter = f'<emitter type="area">{rgb("radiance", 3, 3, 3)}</emitter>'
    lamp = (
        '<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="180"/>'
        f'<translate x="0.8" z="2"/></transform>{emitter}</shape>'
    )
    patches = (placed("rectangle", name, centre(name), bsdf, SIZE) for name, bsdf in PATCHES.items())
    return opened(write(folder, *patches, lamp))


def centre(name):
    row = list(PATCHES).index(name) - len(PATCHES) // 2
    return 0.0, 2.2 * SIZE * row, 0.0


def scattered(renderer, name, angle, from_above=True, branch=None):
    """Samples at the patch of a material, for a viewer at an angle, degrees, from its normal."""
    tilt = np.radians(angle)
    away = np.array([np.sin(tilt), 0.0, np.cos(tilt) if from_above else -np.cos(tilt)])
    rays = Rays(*(vector3(of) + dr.zeros(Array3f, COUNT) for of in (centre(name) + away, -away)))
    point, lanes = renderer.intersect(rays), dr.opaque(UInt, branch or 0, COUNT)
    sample = renderer.sample_specular(point, one_sequence(COUNT), branch=None if branch is None else lanes)
    dr.eval(sample)  # by one kernel
    return sample


def moments(sample):
    """Means of what a constant sky, and one that changes from side to side, contribute; and of the lamp."""
    weight = dr.select(sample.is_alive, sample.throughput, 0.0)
    parts = weight, weight * sample.rays.direction.x, sample.direct
    return np.array([rows(part)[:, 0].mean(dtype=float) for part in parts])


@pytest.mark.parametrize("from_above", [True, False])
@pytest.mark.parametrize("name", INTERFACES)
def test_branches_add_up_to_the_whole(renderer, name, from_above):
    angle = 38.0  # from below, many facets reflect totally
    whole = scattered(renderer, name, angle, from_above)
    parts = [scattered(renderer, name, angle, from_above, int(branch)) for branch in Branch]
    assert dr.all(parts[0].is_split)
    assert not dr.any(whole.is_split)
    assert sum(map(moments, parts)) == pytest.approx(moments(whole), abs=0.004)
    # Each has light of its own side alone, and the lamp is counted once.
    for sample, side in zip(parts, (1, -1) if from_above else (-1, 1), strict=True):
        counts = sample.is_alive & (dr.max(sample.throughput) > 0.0)
        assert dr.all(~counts | (sample.rays.direction.z * side > 0.0))
    assert not np.any(rows(parts[1].direct))
    assert np.any(rows(parts[0].direct)) == np.any(rows(whole.direct))


@pytest.mark.parametrize("from_above", [True, False])
@pytest.mark.parametrize("name", CLEAR)
def test_both_branches_of_clear_interfaces_are_followed(renderer, name, from_above):
    """Also below a bump map: without chance, the reflection has Fresnel's share in every sample."""
    whole = scattered(renderer, name, 30.0, from_above)
    parts = [scattered(renderer, name, 30.0, from_above, int(branch)) for branch in Branch]
    assert all(dr.all(part.is_split & part.is_alive) for part in parts)
    assert sum(map(moments, parts)) == pytest.approx(moments(whole), abs=0.01)
    weights = [rows(part.throughput)[:, 0] for part in parts]
    assert all(np.ptp(weight) < 1e-3 for weight in weights)
    assert weights[0].max() < 0.1 < weights[1].min()
    solid = name != "bumpy pane"
    assert all(dr.all(part.is_interface) == solid for part in parts)
    assert [bool(dr.all(part.is_within)) for part in parts] == [
        solid and not from_above,
        solid and from_above,
    ]


def test_a_reflection_is_as_strong_as_its_share(renderer):
    """Of glass, 4 % along the normal: in every sample, not in one of 25."""
    reflected = scattered(renderer, "principled", 0.0, branch=int(Branch.REFLECTED))
    weight = rows(reflected.throughput)[np.array(Bool(reflected.is_alive)), 0]
    assert len(weight) > 0.9 * COUNT
    assert weight.mean() == pytest.approx(0.04, rel=0.1)
    assert weight.std() < 0.25 * weight.mean()


@pytest.mark.parametrize("name", OTHERS)
def test_other_materials_are_left_to_chance(renderer, name):
    one, other = (scattered(renderer, name, 20.0, branch=int(branch)) for branch in Branch)
    assert not dr.any(one.is_split | other.is_split)
    assert moments(one) == pytest.approx(moments(other))
