"""Emitters that cast sharp shadows: the sun is found, and their light and all other add up to the whole."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from enfilade.arrays import Array3f, Float, UInt, rows
from enfilade.camera.pinhole import Camera, look_at
from enfilade.images import write_exr
from enfilade.kernels.estimate import Estimate, Samples
from enfilade.kernels.random import Discrete, one_sequence
from enfilade.kernels.rays import camera_rays, pixel_centres
from enfilade.methods.decoupled.irradiance_cache import IrradianceCache
from enfilade.renderer import Bounce, PixelFilter, Purpose, RandomKey, Rays
from enfilade.scene.mitsuba.renderer import MitsubaRenderer
from enfilade.scene.mitsuba.sun import find_sun
from support.integrated import shaded, standard_errors, traced
from support.material_scene import pixels_of
from support.mitsuba_scene import opened as opened_file
from support.mitsuba_scene import placed, rgb, write

SUN = np.array([0.6, 0.64, 0.48])
LAMP = """<emitter type="point"><rgb name="intensity" value="{0}"/>
<point name="position" value="{1}, 0.7, {2}"/></emitter>"""
AREA = """<shape type="rectangle"><transform name="to_world"><scale value="0.3"/><rotate x="1" angle="90"/>
<translate y="1.5"/></transform>
<emitter type="area"><rgb name="radiance" value="6, 5, 4"/></emitter></shape>"""
BULB = """<shape type="sphere"><float name="radius" value="{0}"/><point name="center" value="{1}"/>
<emitter type="area"><rgb name="radiance" value="{2}"/></emitter></shape>"""
BULBS = BULB.format(0.05, "0.2, 2.2, -0.2", "400, 300, 200") + BULB.format(
    0.03, "0.28, 0.66, 0.28", "40, 60, 80"
)
SKIES = {
    "sun and sky": '<emitter type="sunsky"><vector name="sun_direction" x="0.6" y="0.64" z="0.48"/>'
    '<float name="sun_scale" value="0.01"/><float name="sky_scale" value="0.3"/></emitter>',
    "photographed": '<emitter type="envmap"><string name="filename" value="sky.exr"/></emitter>',
    "lamps": '<emitter type="point"><rgb name="intensity" value="9"/>'
    '<point name="position" x="0.7" y="1" z="0.8"/>'
    '<float name="sampling_weight" value="0"/></emitter>'
    '<emitter type="directional"><vector name="direction" x="-1" y="-2" z="0.3"/>'
    '<rgb name="irradiance" value="2, 1, 1"/></emitter><emitter type="spot"><transform name="to_world">'
    '<lookat origin="1, 2, 0" target="0, 0, 0" up="0, 0, 1"/></transform>'
    f'<rgb name="intensity" value="3"/></emitter>{LAMP.format(0.4, -0.8, 0.5)}{AREA}',
    "many lamps": "".join(LAMP.format(0.1 + 0.01 * i, i / 10 - 1, i % 3 - 1) for i in range(20)) + AREA,
    "bulbs": '<emitter type="constant"><rgb name="radiance" value="0.1"/></emitter>' + BULBS + AREA,
    "bulbs and faint ones": AREA
    + BULBS
    + "".join(BULB.format(0.02, f"{i - 1.5}, 1.9, 0.6", "3, 4, 5") for i in range(3)),
    "soft": '<emitter type="constant"/>' + AREA,
}
SHARP = {"sun and sky", "photographed", "lamps", "many lamps", "bulbs", "bulbs and faint ones"}


def photographed_sky():
    """A sky whose sun has a radius of one degree, about half of its flux."""
    rows_, columns = np.mgrid[0:256, 0:512] + 0.5
    polar, azimuth = rows_ * np.pi / 256, columns * 2 * np.pi / 512
    sine = np.sin(polar)
    directions = np.stack([sine * np.sin(azimuth), np.cos(polar), -sine * np.cos(azimuth)], axis=-1)
    is_sun = directions @ SUN > np.cos(np.radians(1.0))
    return np.where(is_sun[..., None], [9000.0, 8000.0, 7000.0], [0.5, 0.6, 0.9]).astype(np.float32)


def opened(folder, sky, integrator="path"):
    write_exr(folder / "sky.exr", {"RGB": photographed_sky()}, is_portable=True)
    (folder / "scene.xml").write_text(
        f"""<scene version="3.0.0"><integrator type="{integrator}"/>{sky}
<shape type="rectangle"><transform name="to_world"><scale value="2"/><rotate x="1" angle="-90"/></transform>
<bsdf type="diffuse"><rgb name="reflectance" value="0.5, 0.4, 0.3"/></bsdf></shape>
<shape type="cube"><transform name="to_world"><scale value="0.3"/><translate y="0.3"/></transform></shape>
</scene>"""
    )
    return MitsubaRenderer(folder / "scene.xml")


VEILS = """<shape type="rectangle"><transform name="to_world"><scale x="0.8" y="0.8"/>
<rotate x="1" angle="90"/><translate x="0.9" y="0.65"/></transform>
<bsdf type="mask"><float name="opacity" value="0.4"/>
<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf></bsdf></shape>
<shape type="rectangle"><transform name="to_world"><scale x="0.5" y="0.5"/><rotate x="1" angle="90"/>
<translate x="0.9" y="0.6"/></transform><bsdf type="null"/>
<emitter type="area"><rgb name="radiance" value="0.7"/></emitter></shape>"""
LAMP_BEHIND = VEILS.replace(
    'y="0.6"/></transform><bsdf type="null"/>', 'y="0.7"/></transform><bsdf type="null"/>'
)


VIEW = look_at((1.5, 2.0, 2.5), (0.0, 0.2, 0.0))
CAMERA, FINER = Camera(VIEW, 50.0, 24, 16), Camera(VIEW, 50.0, 48, 32)


def direct_light(renderer, point, sampler, layers):
    """Of the diffuse lobe: soft light, behind some layers of veils, and sharp light together."""
    sample = renderer.sample_diffuse(point, sampler, soft_only=True)

    def add_layer(layer, is_alive, ray, bounce, throughput, found, sampler):
        ahead = renderer.intersect(Rays(*ray), Bounce(*bounce), is_alive)
        found = found + dr.select(is_alive, throughput * ahead.emission, 0.0)
        beyond = renderer.sample_specular(ahead, sampler)
        is_alive = is_alive & beyond.is_alive & beyond.is_passed
        return layer + 1, is_alive, *parts(beyond), throughput * beyond.throughput, found, sampler

    def parts(sample):
        return tuple(vars(sample.rays).values()), tuple(vars(sample.bounce).values())

    state = UInt(0), sample.is_alive, *parts(sample), sample.throughput, sample.direct, sampler
    found = dr.while_loop(state, lambda layer, is_alive, *_: is_alive & (layer < layers), add_layer)[-2]
    return found + renderer.sharp_light(point, sampler).diffuse if renderer.has_sharp_light() else found


def estimated(radiance, camera, spp, layers):
    estimate = Estimate(
        camera, pixels_of(camera), radiance, paths_in_flight=1 << 18, pixel_filter=PixelFilter.BOX,
        random=RandomKey(5, 1, Purpose.DIFFUSE), layers=layers,
    )  # fmt: skip
    estimate.add(spp)
    return estimate.shadings


def share_of_outliers(ours, theirs):
    """Share of pixels that differ by more than four standard deviations."""
    error = (ours.color - theirs.color) @ [0.2126, 0.7152, 0.0722]
    deviation = np.sqrt(ours.variance + theirs.variance) + 1e-4 * theirs.color.max()
    return np.mean(np.abs(error) > 4.0 * deviation)


@pytest.mark.parametrize("name", SKIES)
def test_sharp_and_soft_light_add_up_to_all_direct_light(tmp_path, name):
    renderer = opened(tmp_path, SKIES[name])
    assert renderer.has_sharp_light() == (name in SHARP)

    def both(rays, sampler):
        point = renderer.intersect(rays)
        ours = direct_light(renderer, point, sampler, layers=3)
        return Samples((ours, renderer.estimate_diffuse(point, sampler)[0]))

    ours, whole = estimated(both, CAMERA, spp=256, layers=2)
    assert share_of_outliers(ours, whole) < 0.02
    assert ours.color.mean() == pytest.approx(whole.color.mean(), rel=0.02)


@pytest.mark.parametrize("integrator", ["path", "volpath"])
@pytest.mark.parametrize(("name", "veils"), [*((name, VEILS) for name in SKIES), ("lamps", LAMP_BEHIND)])
def test_veiled_light_is_that_of_the_path_tracer(tmp_path, name, veils, integrator):
    """Behind a cut-out and the shape of a lamp sharp and soft light add up to all direct light, too.

    With `path`, no light of points, spots and directional emitters passes.
    """
    renderer = opened(tmp_path, SKIES[name] + veils, integrator)
    assert renderer.has_sharp_light() == (name in SHARP)

    def radiance(rays, sampler):
        point = renderer.intersect(rays)
        direct, indirect = renderer.estimate_diffuse(point, sampler)
        diffuse = point.surfaces.albedo * (direct + indirect)
        whole = point.emission + diffuse + sum(renderer.estimate_specular(point, sampler))
        return Samples((whole, direct, direct_light(renderer, point, sampler, layers=3)))

    # The path tracer finds the sun and bulbs behind a cut-out by chance: its pixels have rare large errors.
    is_by_chance = integrator == "path" and name in ("photographed", "bulbs")
    camera, spp = (FINER, 512) if is_by_chance else (CAMERA, 256)
    ours, direct, parts = estimated(radiance, camera, spp, layers=3)
    assert share_of_outliers(parts, direct) < 0.02
    assert parts.color.mean() == pytest.approx(direct.color.mean(), rel=0.02)
    key = RandomKey(6, 1, Purpose.REFERENCE)
    theirs = renderer.trace(camera, pixels_of(camera), key, spp=spp, pixel_filter=PixelFilter.BOX)
    assert is_by_chance or share_of_outliers(ours, theirs) < 0.02
    spread = np.sqrt((ours.variance + theirs.variance).mean() / ours.variance.size)
    bound = 0.02 * theirs.color.mean() + (3.0 * spread if is_by_chance else 0.0)
    assert ours.color.mean() == pytest.approx(theirs.color.mean(), abs=float(bound))


@pytest.mark.parametrize("others", [0, 4, 7])
def test_the_light_of_a_small_lamp_counts_once(tmp_path, others):
    """On the cube's side, so near to a bulb that samples of the BSDF often meet it; and in groups."""
    sky = '<emitter type="constant"><rgb name="radiance" value="0.1"/></emitter>'
    far = "".join(LAMP.format(0.3, 1.5 + 0.1 * i, i - 2) for i in range(others))
    renderer = opened(tmp_path, sky + BULB.format(0.02, "0.33, 0.5, 0.28", "40, 60, 80") + far)
    assert dr.width(renderer.state()[-1][0]) == 1 + others
    count = 1 << 16
    origin, beside = np.array([0.6, 0.05, 0.28]), np.array([0.3, 0.48, 0.27])
    rays = Rays(*(Array3f(*map(float, of)) + dr.zeros(Array3f, count) for of in (origin, beside - origin)))
    sampler = one_sequence(count)
    point = renderer.intersect(rays)
    sample = renderer.sample_diffuse(point, sampler, soft_only=True)
    ahead = renderer.intersect(sample.rays, sample.bounce, sample.is_alive)
    found = renderer.sharp_light(point, sampler).diffuse + sample.direct + sample.throughput * ahead.emission
    whole, _ = renderer.estimate_diffuse(point, sampler)
    assert rows(found).mean(axis=0) == pytest.approx(rows(whole).mean(axis=0), rel=0.01)


def test_samples_of_the_sky_beside_a_sun_are_few_times_empty(tmp_path):
    # Half of the sky's flux is that of the sun, and half of the other is below the floor.
    renderer, count = opened(tmp_path, SKIES["photographed"]), 1 << 14
    rays = Rays(*(Array3f(*of) + dr.zeros(Array3f, count) for of in ((-1.5, 1.0, 1.5), (0.0, -1.0, 0.0))))
    sample = renderer.sample_diffuse(renderer.intersect(rays), one_sequence(count), soft_only=True)
    light = rows(sample.direct)[:, 1]
    assert (light > 0.0).mean() > 0.6  # 0.25 with a single candidate
    assert light.std() < 1.5 * light.mean()  # 2.4


@pytest.mark.parametrize("sky", ["sun and sky", "photographed"])
def test_samples_of_the_sun_have_little_noise(tmp_path, sky):
    opened(tmp_path, SKIES[sky])
    scene = mi.load_file(str(tmp_path / "scene.xml"))
    sun = find_sun(scene.environment())
    _, radiance, _ = sun.sample(one_sequence(1 << 14))
    light = rows(Array3f(radiance))[:, 1]
    assert light.std() < 0.15 * light.mean()


@pytest.mark.parametrize("sky", sorted(SHARP))
def test_occluders_take_a_part_of_the_light(tmp_path, sky):
    renderer, camera = opened(tmp_path, SKIES[sky]), Camera(VIEW, 50.0, 48, 32)
    rays = camera_rays(camera, pixel_centres(camera, dr.arange(UInt, 48 * 32)))
    light = renderer.sharp_light(renderer.intersect(rays), one_sequence(48 * 32))
    found, unoccluded = rows(light.diffuse), rows(light.unoccluded)
    assert (found <= unoccluded * 1.00001).all()
    assert 0.2 * unoccluded.mean() < found.mean() < 0.999 * unoccluded.mean()


def bulbs(radiances):
    return "".join(BULB.format(0.02, f"{i / 10 - 1}, 1.5, 0.5", of) for i, of in enumerate(radiances))


def test_of_many_small_lamps_none_casts_sharp_shadows(tmp_path):
    assert not opened(tmp_path, bulbs(["30, 20, 10"] * 5)).has_sharp_light()


def test_faint_lamps_leave_the_shadows_of_others_sharp(tmp_path):
    # Such as the light of a switch; and black ones.
    faint, strong = ["0.5, 0.3, 0.1", "0"], ["30, 20, 10"] * 4
    renderer = opened(tmp_path, bulbs([*faint, *strong]))
    (sharp, *_) = renderer.state()[-1]
    assert np.array(sharp).tolist() == [2, 3, 4, 5]


def test_all_emitters_of_a_scene_may_be_sharp(tmp_path):
    """Then next-event estimates of soft ones are zero, for any number of lanes."""
    ball = """<shape type="sphere"><float name="radius" value="0.4"/>
<point name="center" value="0.9, 0.4, 0.6"/>
<bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf></shape>"""
    pane = """<shape type="rectangle"><transform name="to_world"><translate z="-1"/></transform>
<bsdf type="thindielectric"/></shape>"""
    renderer, cache = opened(tmp_path, BULBS + ball + pane), IrradianceCache(soft_only=True)
    camera = Camera(look_at((1.5, 2.0, 2.5), (0.0, 0.2, 0.0)), 50.0, 48, 36)
    few = shaded(renderer, cache, camera, 4, pixels=300)
    ours, reference = shaded(renderer, cache, camera, 64), traced(renderer, camera, 64)
    assert few.color.shape == (300, 3)
    assert abs(standard_errors(ours, reference)) < 4.0


def test_a_directional_emitter_has_no_noise_but_its_shadow(tmp_path):
    renderer = opened(
        tmp_path,
        '<emitter type="directional"><vector name="direction" x="0" y="-1" z="0"/>'
        '<rgb name="irradiance" value="2, 1, 1"/></emitter>',
    )
    rays = Rays(Array3f([0.0, 1.0, 1.5], 0.1, 0.0), Array3f(0.0, -1.0, 0.0) + dr.zeros(Array3f, 3))
    light = renderer.sharp_light(renderer.intersect(rays), one_sequence(3))
    found, unoccluded = rows(light.diffuse), rows(light.unoccluded)
    assert np.allclose(unoccluded, np.array([2.0, 1.0, 1.0]) / np.pi, rtol=1e-5)
    assert np.allclose(found[1:], unoccluded[1:])
    assert not found[0].any()  # inside the cube


@pytest.mark.parametrize(("name", "radius_deg"), [("sun and sky", 0.267), ("photographed", 1.0)])
def test_the_sun_is_found(tmp_path, name, radius_deg):
    opened(tmp_path, SKIES[name])
    sun = find_sun(mi.load_file(str(tmp_path / "scene.xml")).environment())
    angle_deg = np.degrees(np.arccos(np.clip(np.array(sun.frame.n).ravel() @ SUN, -1.0, 1.0)))
    assert angle_deg < 0.1
    assert radius_deg < np.degrees(np.arctan(sun.extent[0])) < radius_deg + 0.5
    # Elsewhere, and in no direction at all, it has no density.
    directions = np.array([SUN, -SUN, [np.nan] * 3, [np.inf, 0.0, 0.0]], np.float32)
    density = np.array(sun.pdf(mi.Vector3f(directions.T)))
    assert density[0] > 0.0
    assert density[1:].tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("aperture_deg", [0.05, 0.1, 0.2, 0.3, 1.0])
@pytest.mark.parametrize("x", [0.6, 0.61, 0.63])
def test_suns_of_any_size_are_found(tmp_path, aperture_deg, x):
    aperture = f'<float name="sun_aperture" value="{aperture_deg}"/></emitter>'
    opened(tmp_path, SKIES["sun and sky"].replace('x="0.6"', f'x="{x}"').replace("</emitter>", aperture))
    sun = find_sun(mi.load_file(str(tmp_path / "scene.xml")).environment())
    direction = np.array([x, 0.64, 0.48]) / np.linalg.norm([x, 0.64, 0.48])
    angle_deg = np.degrees(np.arccos(np.clip(np.array(sun.frame.n).ravel() @ direction, -1.0, 1.0)))
    assert angle_deg < 0.1 * aperture_deg + 0.02
    assert aperture_deg / 2.0 < np.degrees(np.arctan(sun.extent[0])) < aperture_deg / 2.0 + 0.1


def test_skies_without_a_sun_have_none(tmp_path):
    for sky in ('<emitter type="constant"/>', SKIES["sun and sky"].replace('"0.01"', '"0"'), AREA):
        assert not opened(tmp_path, sky).has_sharp_light()


def test_a_discrete_distribution_draws_in_proportion():
    distribution = Discrete.of(np.array([0.0, 3.0, 0.0, 1.0, 0.0]))
    drawn, within, pmf = distribution.sample((dr.arange(Float, 1000) + 0.5) / 1000)
    assert np.bincount(np.array(UInt(drawn)), minlength=5).tolist() == [0, 750, 0, 250, 0]
    assert np.unique(np.array(pmf)).tolist() == [0.25, 0.75]
    assert np.array(within)[:750] == pytest.approx((np.arange(750) + 0.5) / 750, abs=1e-5)


def test_a_lamp_may_have_any_texture(tmp_path):
    # Mitsuba can't sample rays of patterns other than bitmaps: there are no photons then.
    pattern = '<texture type="checkerboard" name="radiance"/>'
    lamp = placed("rectangle", "lamp", (0, 0, 2), f'<emitter type="area">{pattern}</emitter>', 0.01)
    renderer = opened_file(write(tmp_path, placed("rectangle", "wall", (0, 0, 5), "", 4.0), lamp, sky=""))
    assert renderer.has_sharp_light()
    assert not len(renderer.photons().flux)
    (note,) = renderer.describe().notes
    assert "the emitter lamp has a texture that is no bitmap" in note


def test_small_lamps_are_found_beside_instances(tmp_path):
    # Mitsuba can't sample points on instances.
    group = '<shape type="shapegroup" id="group"><shape type="sphere"/></shape>'
    instance = '<shape type="instance"><ref id="group"/></shape>'
    light = f'<emitter type="area">{rgb("radiance", 7, 7, 7)}</emitter>'
    lamp = placed("rectangle", "lamp", (0, 0, 2), light, 0.01)
    wall = placed("rectangle", "wall", (0, 0, 5), "", 4.0)
    assert opened_file(write(tmp_path, group, instance, lamp, wall, sky="")).has_sharp_light()
