"""With an empty cache the integrator is an unbiased path tracer; with a filled one it is near it."""

import numpy as np
import pytest

from enfilade.arrays import UInt, lanes, rows
from enfilade.camera.pinhole import Camera, look_at
from enfilade.gbuffer import find_geometry, positions
from enfilade.images import write_exr
from enfilade.kernels.random import one_sequence
from enfilade.kernels.rays import camera_rays, pixel_centres
from enfilade.methods.decoupled.hash_grid_entries import Entries
from enfilade.methods.decoupled.irradiance_cache import IrradianceCache, upload
from enfilade.methods.decoupled.paths import compact, spawn
from enfilade.methods.decoupled.virtual_images import IN_VIRTUAL_IMAGE, VirtualImages
from support.integrated import (
    EMPTY,
    LUMINANCE,
    assert_same_in_batches,
    cache_of,
    cache_of_uploaded,
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
    pane,
    pixels_of,
    specular_aovs,
    traced_irradiance,
)


@pytest.fixture(scope="module")
def diffuse(tmp_path_factory):
    """Diffuse balls, with the irradiance of two images: pairs of G-buffer and record."""
    balls = {"one": MATERIALS["diffuse"], "two": MATERIALS["diffuse"]}
    renderer = opened_scene(tmp_path_factory.mktemp("diffuse"), balls)
    return renderer, [traced_irradiance(renderer, front_camera(x=x)) for x in (-0.5, 0.5)]


def test_without_a_cache_partly_transparent_surfaces_keep_their_energy(tmp_path):
    def veil(share):
        black = '<bsdf type="diffuse"><rgb name="reflectance" value="0.02"/></bsdf>'
        return f'<bsdf type="mask"><float name="opacity" value="{share}"/>{black}</bsdf>'

    camera = front_camera()
    where = find_geometry(opened_scene(tmp_path, {"veil": veil(1.0)}), camera).shape_index.ravel() == 1
    assert where.sum() > 20
    renderer = opened_scene(tmp_path, {"veil": veil(0.3)})
    ours, reference = shaded(renderer, EMPTY, camera, 1024), traced(renderer, camera, 1024)
    assert abs(standard_errors(ours, reference, where)) < 4.0
    deviation = np.sqrt((ours.variance + reference.variance)[where].sum())
    assert deviation < 0.05 * (reference.color @ LUMINANCE)[where].sum()


def test_with_a_cache_one_sample_is_near_many_paths(diffuse):
    renderer, images = diffuse
    camera = front_camera()
    cached, uncached = (shaded(renderer, of, camera, 1) for of in (cache_of(*images), EMPTY))
    reference = traced(renderer, camera, 1024).color
    error, error_uncached = (np.sqrt(((c.color - reference) ** 2).mean()) for c in (cached, uncached))
    # Irradiance of 512 paths for one camera ray; shadow edges and surfaces in neither image remain.
    assert error < 0.25 * error_uncached
    assert abs(cached.color.mean() / reference.mean() - 1.0) < 0.02


def test_irradiance_of_one_view_is_valid_in_another(tmp_path):
    checks = (
        '<texture type="checkerboard" name="reflectance"><rgb name="color0" value="0.8, 0, 0"/>'
        '<rgb name="color1" value="0.8"/><transform name="to_uv"><scale x="9" y="9"/></transform></texture>'
    )
    balls = {
        "blend": MATERIALS["blend"],
        "two sides": f'<bsdf type="twosided">{MATERIALS["blend"]}</bsdf>',
        "checks": f'<bsdf type="diffuse">{checks}</bsdf>',
        "principled": MATERIALS["principled"],
    }
    renderer = opened_scene(tmp_path, balls)
    image = traced_irradiance(renderer, front_camera(96, 72))
    camera = Camera(look_at((4, 1.8, 5), (0, 0.7, 0)), 36, 48, 36)
    ours, reference = shaded(renderer, cache_of(image), camera, 64), traced(renderer, camera, 256)
    shape_index = find_geometry(renderer, camera).shape_index.ravel()
    ratios = {
        name: ours.color[shape_index == number].sum(axis=0)
        / reference.color[shape_index == number].sum(axis=0)
        for number, name in enumerate(renderer.describe().shapes, 1)
        if name in balls
    }
    assert set(ratios) == set(balls)
    assert {name: ratio for name, ratio in ratios.items() if np.abs(ratio - 1.0).max() > 0.04} == {}


def test_irradiance_under_a_coat_seen_at_a_grazing_angle_is_valid_from_above(tmp_path):
    """A coat transmits a fifth less at a grazing angle: the irradiance must not contain that."""
    coats = ("plastic", "roughplastic")
    tables = "".join(
        f'</shape><shape type="rectangle" id="table {x}"><transform name="to_world"><scale x="0.5"/>'
        f'<rotate x="1" angle="-90"/><translate x="{x}" y="1.5"/></transform>{MATERIALS[name]}'
        for name, x in zip(coats, (-0.5, 0.5), strict=True)
    )
    renderer = opened_scene(tmp_path, {"ball": tables})
    grazing = Camera(look_at((0, 1.75, 2.5), (0, 1.5, 0)), 36, 96, 36)
    steep = Camera(look_at((0, 3.6, 0.8), (0, 1.5, 0)), 25, 32, 24)
    shape_index = find_geometry(renderer, steep).shape_index.ravel()
    ours = shaded(renderer, cache_of(traced_irradiance(renderer, grazing)), steep, 64).color @ LUMINANCE
    reference = traced(renderer, steep, 256).color @ LUMINANCE
    for name, x in zip(coats, (-0.5, 0.5), strict=True):
        where = shape_index == renderer.describe().shapes.index(f"table {x}") + 1
        assert where.sum() > 200, name
        assert ours[where].sum() / reference[where].sum() == pytest.approx(1.0, abs=0.03), name


def test_an_image_is_found_at_its_own_pixels(diffuse):
    renderer, ((geometry, irradiance), _) = diffuse
    camera = geometry.camera
    image = shaded(renderer, cache_of((geometry, irradiance)), camera, 1).color.reshape(36, 48, 3)
    expected = geometry.albedo * (irradiance.direct.color + irradiance.indirect.color)
    # Floor and back wall; the lamp emits, and taps at the edges of balls lie on other surfaces.
    inside = (geometry.shape_index == 3) | (geometry.shape_index == 4)
    assert (np.abs(image - expected).max(axis=2)[inside] > 0.01).mean() < 0.02


def test_surfaces_in_no_image_are_path_traced(diffuse):
    renderer, images = diffuse
    away = Camera(look_at((0, 1.5, 3), (3.5, 0.5, -1.5)), 30, 24, 18)
    cached, reference = shaded(renderer, cache_of(images[0]), away, 128), traced(renderer, away, 128)
    difference = ((cached.color - reference.color) @ LUMINANCE).mean()
    deviation = np.sqrt((cached.variance + reference.variance).sum()) / cached.variance.size
    assert abs(difference) < 4.0 * deviation + 0.01 * reference.color.mean()


def test_final_gathering_under_an_environment_map(tmp_path):
    # Directions in which the sampled lobe reflects nothing count as samples, too.
    rows = np.linspace(0.2, 0.6, 16, dtype=np.float32)
    write_exr(tmp_path / "sky.exr", {"RGB": np.tile(rows[:, None, None], (1, 32, 3))}, is_portable=True)
    sky = '<emitter type="envmap"><string name="filename" value="sky.exr"/></emitter>'
    renderer, camera = opened_scene(tmp_path, {"blend": MATERIALS["blend"]}, sky), front_camera()
    irradiance = traced_irradiance(renderer, camera)[1]
    found = gathered(renderer, EMPTY, camera, 64)
    for ours, reference in zip(found, (irradiance.direct, irradiance.indirect), strict=True):
        assert abs(standard_errors(ours, reference)) < 4.0
        assert ours.dropped == 0


def test_final_gathering_without_a_cache_at_any_number_of_pixels(diffuse):
    # A recorded kernel returns literals in the size of its first call.
    renderer, _ = diffuse
    few, many = (gathered(renderer, EMPTY, front_camera(), 4, pixels=count)[1] for count in (500, 900))
    np.testing.assert_array_equal(few.color, many.color[:500])


def test_a_hash_grid_without_images_gives_its_light(diffuse):
    renderer, _ = diffuse
    parts = []
    camera = front_camera()

    def collect(levels, irradiance):
        parts.append(Entries.of(levels, irradiance))

    def radiance(rays, sampler):
        integrator = integrator_of(renderer)
        return integrator.final_gather(EMPTY, camera_paths(rays, sampler), collect)

    estimated(radiance, camera, 64, layers=2)
    grid = Entries.joined(parts).upload()
    assert grid is not None
    found, reference = (
        gathered(renderer, cache, camera, 16)[1] for cache in (IrradianceCache(hash_grid=grid), EMPTY)
    )
    assert found.color.mean() == pytest.approx(reference.color.mean(), rel=0.05)


def test_no_paths_have_no_irradiance(diffuse):
    renderer, _ = diffuse
    pixels = pixels_of(front_camera())[:10]
    path = spawn(
        camera_rays(front_camera(), pixel_centres(front_camera(), lanes(pixels))), one_sequence(10), 0.0
    )
    (found,) = integrator_of(renderer).path_traced(EMPTY, compact(path, UInt()), 10).layers
    assert rows(found).tolist() == [[0.0] * 3] * 10


def test_metal_and_glass_have_no_diffuse_lobe(tmp_path):
    balls = {
        name: f'<bsdf type="principled"><float name="{name}" value="{share}"/></bsdf>'
        for name, share in (("metallic", 1.0), ("spec_trans", 0.75), ("roughness", 1.0))
    }
    renderer = opened_scene(tmp_path, balls)
    geometry = find_geometry(renderer, front_camera())
    names = renderer.describe().shapes
    albedos = [geometry.albedo[geometry.shape_index == names.index(name) + 1].mean() for name in balls]
    assert albedos == pytest.approx([0.0, 0.125, 0.5], abs=0.01)


def test_images_of_weight_zero_add_no_surfaces(diffuse):
    renderer, images = diffuse
    # At ten times the resolution some points have taps of tiny weight.
    finer = find_geometry(renderer, front_camera(width=480, height=360, x=-0.5))
    at = [lanes(values) for values in (positions(finer), finer.normal, finer.shape_index)]
    image = upload(*images[0])
    alone, filled = cache_of_uploaded([image]), cache_of_uploaded([image] * 6, [1.0, *[0.0] * 5])
    np.testing.assert_array_equal(np.array(alone.lookup(*at)[1]), np.array(filled.lookup(*at)[1]))


def test_the_view_of_a_cache_is_looked_up_like_its_images(diffuse):
    renderer, images = diffuse
    geometry = find_geometry(renderer, front_camera())
    at = [lanes(values) for values in (positions(geometry), geometry.normal, geometry.shape_index)]
    image, other = (upload(*one) for one in images[:2])
    cache = cache_of_uploaded([other], view=image)
    (found, is_found), (expected, is_expected) = (
        cache.lookup_in_view(*at),
        cache_of_uploaded([image]).lookup(*at),
    )
    assert np.array(is_found).mean() > 0.5
    np.testing.assert_array_equal(np.array(is_found), np.array(is_expected))
    np.testing.assert_array_equal(np.array(found), np.array(expected))
    assert not np.array(cache_of_uploaded([other]).lookup_in_view(*at)[1]).any()


def test_other_scenes_may_be_open(tmp_path):
    # Mitsuba numbers the materials of all open scenes; one of them is an emitting mesh.
    mesh = '<emitter type="area"><rgb name="radiance" value="1"/></emitter></shape><shape type="cube">'
    shared = '</shape><bsdf type="diffuse" id="used"/><bsdf type="conductor" id="unused"/><shape type="cube">'
    balls = {"glass": '<bsdf type="dielectric"/>', "plastic": f'{shared}{mesh}<ref id="used"/>'}
    camera = front_camera(24, 18)

    def lobes(renderer):
        def radiance(rays, sampler):
            point = renderer.intersect(rays)
            diffuse = point.surfaces.albedo * sum(renderer.estimate_diffuse(point, sampler))
            return diffuse + sum(renderer.estimate_specular(point, sampler))

        return estimated(radiance, camera, spp=4)[0].color

    earlier = opened_scene(tmp_path, balls)
    alone = lobes(earlier)
    assert alone.any()
    later = opened_scene(tmp_path, balls)
    for renderer in (later, earlier):
        np.testing.assert_array_equal(lobes(renderer), alone)


def test_batches_change_no_byte(diffuse):
    # The number of lanes of a recorded kernel is padded, also that of the last batch.
    assert_same_in_batches(diffuse[0], cache_of(*diffuse[1]))


@pytest.mark.parametrize(
    ("panes", "has_reflection", "has_transmission"),
    [
        ([("front", 0.0, 1.0), ("second", 1.0, 0.0)], True, False),
        ([("front", 0.0, 1.0), ("second", 0.0, 1.0)], False, True),
    ],
)
def test_reflection_and_transmission_of_panes_are_separate_aovs(
    tmp_path, panes, has_reflection, has_transmission
):
    balls = {f"ball {k}": pane(name, 1.0 - 0.01 * k, *shares) for k, (name, *shares) in enumerate(panes)}
    renderer, camera = opened_scene(tmp_path, balls), front_camera()
    seen = find_geometry(renderer, camera)
    is_between = positions(seen)[..., 1] < 0.3  # where the floor between the panes may be visible
    where = ((seen.shape_index == renderer.describe().shapes.index("front") + 1) & ~is_between).ravel()
    reflected, transmitted = (aov.color[where] for aov in specular_aovs(renderer, camera))
    assert (reflected.any(), transmitted.any()) == (has_reflection, has_transmission)


def test_total_internal_reflection_is_transmission(tmp_path):
    cube = (
        '<transform name="to_world"><rotate y="1" angle="45"/><translate y="1.5" z="2"/></transform>'
        '<bsdf type="dielectric"><rgb name="specular_reflectance" value="1"/></bsdf>'
    )
    ball = f'{MATERIALS["diffuse"]}</shape><shape type="cube" id="block">{cube}'
    renderer, camera = opened_scene(tmp_path, {"ball": ball}), front_camera()
    seen, images = find_geometry(renderer, camera), VirtualImages(renderer)
    where = seen.shape_index == renderer.describe().shapes.index("block") + 1
    reflected, transmitted = (aov.to_image(where | True) for aov in specular_aovs(renderer, camera, 64))
    assert where.mean() > 0.1
    # Much of the transmission is reflected totally by the second face. Fresnel reflection is 4 to 8 %.
    shares = (aov.color[where].mean() for aov in (reflected, transmitted))
    assert next(shares) < 0.25 * next(shares)
    assert (images.find(seen)[1].shape_index[where] >= IN_VIRTUAL_IMAGE).all()
