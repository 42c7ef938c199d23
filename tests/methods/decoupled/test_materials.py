"""The integrator on every material: energy, irradiance, AOVs, the same bytes in batches."""

import drjit as dr
import numpy as np
import pytest
from PIL import Image

from enfilade.gbuffer import find_geometry
from enfilade.kernels.estimate import Samples
from enfilade.methods.decoupled.irradiance_cache import IrradianceCache
from enfilade.records import Shading
from support.integrated import (
    EMPTY,
    LUMINANCE,
    assert_same_in_batches,
    cache_of,
    estimated,
    gathered,
    shaded,
    standard_errors,
    traced,
)
from support.material_scene import (
    MATERIALS,
    camera_paths,
    front_camera,
    integrator_of,
    opened_scene,
    specular_aovs,
    traced_irradiance,
)

# Alone in this file: while a scene is open, its materials are compiled into the kernels of all scenes. Tests
# that open their own scene come first, before the scene of the others.


def large_errors(renderer, camera, ours, reference):
    """Differences of energy above four standard errors, by the name of the shape."""
    shape_index = find_geometry(renderer, camera).shape_index.ravel()
    names = renderer.describe().shapes
    errors = {
        names[number - 1]: standard_errors(ours, reference, shape_index == number)
        for number in np.unique(shape_index[shape_index > 0])
    }
    assert set(MATERIALS) < set(errors)
    return {name: error for name, error in errors.items() if abs(error) > 4.0}


def test_highlights_of_sharp_emitters_are_counted_once(tmp_path):
    """Those of small lamps, the sun and a point, by camera rays and specular rays, on every material."""
    sky = (
        '<emitter type="sunsky"><vector name="sun_direction" x="0.3" y="0.6" z="0.7"/>'
        '<float name="sun_scale" value="0.01"/><float name="sky_scale" value="0.3"/></emitter>'
        '<emitter type="point"><point name="position" value="-2, 3.5, 2.5"/>'
        '<rgb name="intensity" value="4"/></emitter>'
    )
    bulbs = "".join(
        f'<shape type="sphere"><float name="radius" value="0.06"/><point name="center" value="{at}"/>'
        '<emitter type="area"><rgb name="radiance" value="150"/></emitter></shape>'
        for at in ("1.8, 3.6, 2.2", "0.2, 3.8, 3")
    )
    renderer, camera = opened_scene(tmp_path, MATERIALS, sky + bulbs), front_camera()
    assert dr.width(renderer.state()[-1][0]) == 3  # sharp emitters beside the sun
    ours = shaded(renderer, IrradianceCache(soft_only=True), camera, 256)
    reference = traced(renderer, camera, 256)
    assert large_errors(renderer, camera, ours, reference) == {}

    # Metal has no diffuse lobe: what camera rays see there are its highlights.
    shape_index = find_geometry(renderer, camera).shape_index.ravel()
    is_metal = shape_index == renderer.describe().shapes.index("roughconductor") + 1

    def seen(cache):
        def radiance(rays, sampler):
            found = integrator_of(renderer).diffuse_radiance(cache, camera_paths(rays, sampler))
            return found.layers[0]

        return estimated(radiance, camera, 16)[0].color.reshape(-1, 3)[is_metal]

    assert seen(IrradianceCache(soft_only=True)).max() > 0.2
    assert not seen(EMPTY).any()


def test_light_that_passes_null_interactions_keeps_its_energy(tmp_path):
    """By a path tracer whose shadow rays pass them: light of all kinds behind panes, cut-outs and lamps.

    Four layers are above the scene, more than are followed before the rest is path traced. They are above the
    lamp, too: behind three layers Mitsuba's shadow rays take the surface of a near emitter for an occluder.
    """
    sun = '<emitter type="directional"><vector name="direction" x="-0.1" y="-0.9" z="-0.4"/></emitter>'
    sky = (
        '<emitter type="sunsky"><vector name="sun_direction" x="0.1" y="0.8" z="0.6"/>'
        '<float name="sun_scale" value="0.01"/><float name="sky_scale" value="0.3"/></emitter>'
    )
    layers = "".join(
        f'<shape type="rectangle"><transform name="to_world"><scale value="6"/><rotate x="1" angle="90"/>'
        f'<translate y="{4.1 + 0.1 * layer}"/></transform><bsdf type="mask">'
        '<float name="opacity" value="0.2"/><bsdf type="diffuse"/></bsdf></shape>'
        for layer in range(4)
    )
    names = "diffuse", "roughplastic", "thindielectric", "one-sided, from behind", "glowing air"
    card = (
        f'<bsdf type="blendbsdf"><float name="weight" value="0.3"/><bsdf type="null"/>{MATERIALS["diffuse"]}'
    )
    balls = {name: MATERIALS[name] for name in names} | {"leaf card": f"{card}</bsdf>"}
    renderer = opened_scene(tmp_path, balls, sky + sun + layers, "volpath")
    camera = front_camera()
    ours, reference = shaded(renderer, EMPTY, camera, 256), traced(renderer, camera, 256)
    shape_index = find_geometry(renderer, camera).shape_index.ravel()
    numbers = [number for number in np.unique(shape_index) if number]
    errors = [standard_errors(ours, reference, shape_index == number) for number in numbers]
    assert len(errors) >= len(balls)
    assert np.abs(errors).max() < 4.0

    def irradiance(rays, sampler):
        """By final gathering, with the sharp light apart; and by path tracing."""
        gathered = integrator_of(renderer).final_gather(EMPTY, camera_paths(rays, sampler))
        point = renderer.intersect(rays, opaque_only=True)
        sharp = renderer.sharp_light(point, sampler.fork(1)).diffuse
        return Samples((sum(gathered.layers) + sharp, sum(renderer.estimate_diffuse(point, sampler.fork(2)))))

    ours, reference = estimated(irradiance, camera, 256, layers=2)
    assert abs(standard_errors(ours, reference)) < 4.0


METAL = '<bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf>'


def test_below_maps_energy_is_kept_and_the_albedo_is_that_of_the_nested_bsdf(tmp_path):
    waves = np.uint8(127 + 120 * np.sin(np.arange(64) * 0.8))
    Image.fromarray(np.broadcast_to(waves, (64, 64)).copy()).save(tmp_path / "waves.png")
    tilted = np.broadcast_to(np.uint8([200, 128, 230]), (4, 4, 3)).copy()
    Image.fromarray(tilted).save(tmp_path / "tilted.png")

    def texture(name, file):
        return (
            f'<texture type="bitmap" name="{name}"><string name="filename" value="{file}"/>'
            '<boolean name="raw" value="true"/></texture>'
        )

    paint, color = MATERIALS["diffuse"], '<rgb name="base_color" value="0.6, 0.4, 0.2"/>'
    bumps = f'{texture("height", "waves.png")}<float name="scale" value="0.1"/>'
    tilt = texture("normalmap", "tilted.png")
    half_metal = f'<bsdf type="blendbsdf"><float name="weight" value="0.5"/>{METAL}{paint}</bsdf>'
    principled = f'<bsdf type="principled">{color}<float name="metallic" value="0.75"/></bsdf>'
    balls = {
        "bumpy": f'<bsdf type="bumpmap">{bumps}{paint}</bsdf>',
        "tilted": f'<bsdf type="normalmap">{tilt}{paint}</bsdf>',
        "bumpy half metal": f'<bsdf type="bumpmap">{bumps}{half_metal}</bsdf>',
        "tilted both sides": f'<bsdf type="twosided"><bsdf type="normalmap">{tilt}{half_metal}</bsdf></bsdf>',
        "tilted mostly metal": f'<bsdf type="normalmap">{tilt}{principled}</bsdf>',
    }
    part = {"bumpy half metal": 0.5, "tilted both sides": 0.5, "tilted mostly metal": 0.25}
    renderer, camera = opened_scene(tmp_path, balls), front_camera()
    geometry, names = find_geometry(renderer, camera), renderer.describe().shapes
    ours, reference = shaded(renderer, EMPTY, camera, 256), traced(renderer, camera, 256)
    for name in balls:
        here = geometry.shape_index == names.index(name) + 1
        assert np.ptp(geometry.albedo[here], axis=0).max() < 1e-5
        assert geometry.albedo[here][0] == pytest.approx(np.array([0.6, 0.4, 0.2]) * part.get(name, 1.0))
        assert abs(standard_errors(ours, reference, here.ravel())) < 4.0


@pytest.fixture(scope="module")
def materials(tmp_path_factory):
    """Balls of all materials, and the path traced irradiance of an image."""
    renderer = opened_scene(tmp_path_factory.mktemp("materials"), MATERIALS)
    return renderer, traced_irradiance(renderer, front_camera())[1]


def test_without_a_cache_every_material_keeps_its_energy(materials):
    renderer, camera = materials[0], front_camera()
    ours, reference = shaded(renderer, EMPTY, camera, 256), traced(renderer, camera, 256)
    # Of 18 shapes one exceeds four standard errors once in 1000 runs.
    assert large_errors(renderer, camera, ours, reference) == {}


def test_final_gathering_converges_to_path_traced_irradiance(materials):
    renderer, irradiance = materials
    camera = front_camera()
    filled = cache_of((find_geometry(renderer, camera), irradiance))
    for cached, bias in ((EMPTY, 0.0), (filled, 0.02)):
        found = gathered(renderer, cached, camera, 64)
        wanted = irradiance.direct, irradiance.indirect
        # Emission that a scattered path meets beyond a cut-out or thin glass is in the second layer.
        assert found[0].color.mean() == pytest.approx(wanted[0].color.mean(), rel=0.03)
        ours, reference = (
            Shading(first.color + second.color, first.variance + second.variance)
            for first, second in (found, wanted)
        )
        error = standard_errors(ours, reference)
        deviation = np.sqrt((ours.variance + reference.variance.ravel()).sum())
        assert abs(error) < 4.0 + bias * (reference.color @ LUMINANCE).sum() / deviation


def test_only_clear_surfaces_have_a_transmission_aov(materials):
    renderer, camera = materials[0], front_camera()
    seen, (_, transmitted) = find_geometry(renderer, camera), specular_aovs(renderer, camera)
    names = renderer.describe().shapes
    clear = {names[k - 1] for k in np.unique(seen.shape_index.ravel()[transmitted.color.any(axis=1)])}
    assert clear == {"dielectric", "thindielectric", "glowing air", "one-sided, from behind"}


def test_no_diffuse_reflection_where_a_bsdf_has_none(materials):
    renderer, camera = materials[0], front_camera()
    seen, names = find_geometry(renderer, camera), renderer.describe().shapes
    albedo = {
        name: seen.albedo[seen.shape_index == k].max() for k, name in enumerate(names, 1) if name in MATERIALS
    }
    assert albedo["one-sided, from behind"] == 0.0
    assert albedo["translucent"] == pytest.approx(0.6 * (1.0 - 1.6 / 2.0), abs=1e-6)


def test_batches_change_no_byte(materials):
    # The number of lanes of a recorded kernel is padded, also that of the last batch.
    assert_same_in_batches(materials[0], EMPTY)
