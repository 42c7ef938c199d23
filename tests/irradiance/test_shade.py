"""With an empty cache the estimator is a path tracer; with a full one it is near it."""

import numpy as np
import pytest

from enfilade.arrays import lanes
from enfilade.backends.mitsuba3 import MitsubaRenderer
from enfilade.camera import Camera, look_at
from enfilade.codec import write_exr
from enfilade.geometry import find_geometry, positions
from enfilade.irradiance import (
    LightCache,
    Shader,
    VirtualImages,
    open_cache,
    open_page,
    open_scattered,
    over_time,
    smoothed,
)
from enfilade.irradiance.virtual import BEHIND
from enfilade.pixels.estimate import Estimate, Samples
from enfilade.records import LightPage, Shading
from enfilade.renderer import PixelFilter, Purpose, RandomKey
from enfilade.scenes import write_scene
from enfilade.settings import TraceSettings
from keyframes_analytic import geometry_of
from scenes_analytic import wall

PIXEL_ANGLE = 0.02  # radians
CONSTANT = '<emitter type="constant"><rgb name="radiance" value="0.3"/></emitter>'
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
TINT = '<rgb name="{}" value="0.6, 0.4, 0.2"/>'
ROUGH = '<float name="alpha" value="0.25"/>'
MATERIALS = {
    "diffuse": f'<bsdf type="diffuse">{TINT.format("reflectance")}</bsdf>',
    "plastic": f'<bsdf type="plastic">{TINT.format("diffuse_reflectance")}</bsdf>',
    "roughplastic": f'<bsdf type="roughplastic">{ROUGH}{TINT.format("diffuse_reflectance")}</bsdf>',
    "conductor": '<bsdf type="conductor"/>',
    "roughconductor": f'<bsdf type="roughconductor">{ROUGH}</bsdf>',
    "dielectric": '<bsdf type="dielectric"/>',
    "roughdielectric": f'<bsdf type="roughdielectric">{ROUGH}</bsdf>',
    "thindielectric": '<bsdf type="thindielectric"/>',
    "principled": f'<bsdf type="principled">{TINT.format("base_color")}<float name="roughness" value="0.3"/>'
    '<float name="metallic" value="0.3"/><float name="specular" value="0.8"/></bsdf>',
    "blend": f'<bsdf type="blendbsdf"><float name="weight" value="0.4"/><bsdf type="diffuse"/>'
    f'<bsdf type="roughconductor">{ROUGH}</bsdf></bsdf>',
    "mask": f'<bsdf type="mask"><float name="opacity" value="1"/>'
    f'<bsdf type="roughplastic">{ROUGH}</bsdf></bsdf>',
    "twosided": f'<bsdf type="twosided"><bsdf type="roughplastic">{ROUGH}</bsdf></bsdf>',
    "glowing air": '<bsdf type="null"/><emitter type="area"><rgb name="radiance" value="0.4"/></emitter>',
}


def _plane(name: str, transform: str, color: str) -> str:
    return (
        f'<shape type="rectangle" id="{name}"><transform name="to_world">{transform}</transform>'
        f'<bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="{color}"/></bsdf></bsdf>'
        "</shape>"
    )


def _scene(balls: dict[str, str], sky: str = CONSTANT) -> str:
    shapes = [
        f'<shape type="sphere" id="{name}"><float name="radius" value="0.42"/>'
        f'<point name="center" x="{i % 4 - 1.5}" y="{0.5 + i // 4}" z="0"/>{bsdf}</shape>'
        for i, (name, bsdf) in enumerate(balls.items())
    ]
    shapes.append(_plane("floor", '<scale value="4"/><rotate x="1" angle="-90"/>', "0.6, 0.6, 0.5"))
    shapes.append(_plane("back", '<scale value="4"/><translate z="-1.5"/>', "0.2, 0.5, 0.7"))
    lamp = (
        '<shape type="rectangle" id="lamp"><transform name="to_world"><scale value="0.8"/>'
        '<rotate x="1" angle="90"/><translate y="4" z="1"/></transform>'
        '<emitter type="area"><rgb name="radiance" value="8"/></emitter></shape>'
    )
    # No limit of depth: where a path is cut off, the two estimators cut differently.
    integrator = '<integrator type="path"><integer name="max_depth" value="-1"/></integrator>'
    return f'<scene version="3.0.0">{integrator}{"".join(shapes)}{lamp}{sky}</scene>'


def _opened(folder, balls: dict[str, str], sky: str = CONSTANT) -> MitsubaRenderer:
    file = folder / "scene.xml"
    file.write_text(_scene(balls, sky))
    return MitsubaRenderer(file, TraceSettings())


def _camera(width: int = 48, height: int = 36, x: float = 0.0) -> Camera:
    return Camera(look_at((x, 1.8, 6), (0.6 * x, 1.5, 0)), 36, width, height)


def _shaded(renderer, cache: LightCache, camera: Camera, spp: int, seed: int = 2, **more) -> Shading:
    whole = Estimate(
        camera,
        np.arange(camera.width * camera.height, dtype=np.uint32),
        _shade(renderer, cache),
        chunk=more.get("chunk", 1 << 20),
        pixel_filter=more.get("pixel_filter", PixelFilter.CENTRE),
        random=RandomKey(seed, 0, Purpose.GATHER),
        is_stratified=True,
    )
    whole.add(spp)
    return whole.shading


def _shade(renderer, cache: LightCache):
    shader = Shader(renderer)

    def radiance(rays, rng, square):
        seen = shader.seen(cache, cache, rays, rng, pixel_angle=PIXEL_ANGLE).layers[0]
        scattered = shader.scattered(cache, rays, rng, square, pixel_angle=PIXEL_ANGLE)
        return seen + sum(scattered.layers)

    return radiance


def _scattered(renderer, camera: Camera, spp: int = 8) -> list[Shading]:
    """In layers: reflected, transmitted."""
    shader = Shader(renderer)
    whole = Estimate(
        camera,
        np.arange(camera.width * camera.height, dtype=np.uint32),
        lambda rays, rng, square: shader.scattered(LightCache(), rays, rng, square, pixel_angle=PIXEL_ANGLE),
        chunk=1 << 20,
        pixel_filter=PixelFilter.CENTRE,
        random=RandomKey(2, 0, Purpose.SCATTER),
        layers=2,
        is_stratified=True,
    )
    whole.add(spp)
    return whole.shadings


def _pane(name: str, z: float, reflectance: float = 1.0, transmittance: float = 1.0) -> str:
    """A ball's material, its end, and an upright pane, but for its end."""
    return (
        f'{MATERIALS["diffuse"]}</shape><shape type="rectangle" id="{name}"><transform name="to_world">'
        f'<scale value="3"/><translate z="{z}"/></transform><bsdf type="thindielectric">'
        f'<rgb name="specular_reflectance" value="{reflectance}"/>'
        f'<rgb name="specular_transmittance" value="{transmittance}"/></bsdf>'
    )


def _traced(renderer, camera: Camera, spp: int) -> Shading:
    pixels = np.arange(camera.width * camera.height, dtype=np.uint32)
    return renderer.trace(camera, pixels, RandomKey(1, 0, Purpose.REFERENCE), spp=spp)


def test_without_a_cache_every_material_keeps_its_energy(tmp_path):
    renderer, camera = _opened(tmp_path, MATERIALS), _camera()
    ours, reference = _shaded(renderer, LightCache(), camera, 256), _traced(renderer, camera, 256)
    item = find_geometry(renderer, camera).item.ravel()
    names = renderer.describe().items
    misses = {}
    for number in np.unique(item[item > 0]):
        where = item == number
        difference = ((ours.color - reference.color) @ LUMINANCE)[where].sum()
        deviation = np.sqrt((ours.variance + reference.variance)[where].sum())
        misses[names[number - 1]] = difference / deviation
    assert set(MATERIALS) < set(misses)
    # Standard errors of sums over a ball's pixels; 15 items, so that four are passed once in a thousand runs.
    assert {name: miss for name, miss in misses.items() if abs(miss) > 4.0} == {}


@pytest.mark.parametrize("opacity", [0.3, 0.7])
def test_without_a_cache_veils_keep_their_energy(tmp_path, opacity):
    def veil(share):
        black = '<bsdf type="diffuse"><rgb name="reflectance" value="0.02"/></bsdf>'
        return f'<bsdf type="mask"><float name="opacity" value="{share}"/>{black}</bsdf>'

    where = find_geometry(_opened(tmp_path, {"veil": veil(1.0)}), _camera()).item.ravel() == 1
    renderer, camera = _opened(tmp_path, {"veil": veil(opacity)}), _camera()
    ours, reference = _shaded(renderer, LightCache(), camera, 1024), _traced(renderer, camera, 1024)
    difference = ((ours.color - reference.color) @ LUMINANCE)[where]
    deviation = np.sqrt((ours.variance + reference.variance)[where].sum())
    assert where.sum() > 20
    assert abs(difference.sum()) < 4.0 * deviation
    assert deviation < 0.05 * (reference.color @ LUMINANCE)[where].sum()


@pytest.fixture(scope="module")
def diffuse(tmp_path_factory):
    """Diffuse balls, with the light of two pages."""
    renderer = _opened(
        tmp_path_factory.mktemp("diffuse"), {"one": MATERIALS["diffuse"], "two": MATERIALS["diffuse"]}
    )
    pages = [_page(renderer, _camera(x=x)) for x in (-0.5, 0.5)]
    return renderer, pages


def _opened_cache(pages: list[LightPage]) -> LightCache:
    return open_cache([open_page(page) for page in pages], [1.0] * len(pages))


def _page(renderer, camera: Camera) -> LightPage:
    light = Estimate(
        camera,
        np.arange(camera.width * camera.height, dtype=np.uint32),
        lambda rays, rng: Samples(renderer.light(renderer.lit(rays), rng)),
        chunk=1 << 20,
        pixel_filter=PixelFilter.CENTRE,
        random=RandomKey(3, 0, Purpose.LIGHT),
        layers=2,
    )
    light.add(256)
    size = (camera.height, camera.width)
    direct, indirect = (Shading(s.color.reshape(*size, 3), s.variance.reshape(size)) for s in light.shadings)
    return LightPage(0, find_geometry(renderer, camera), direct, indirect, np.ones(size, bool))


def test_with_a_cache_one_sample_is_near_many_paths(diffuse):
    renderer, pages = diffuse
    camera = _camera()
    cached = _shaded(renderer, _opened_cache(pages), camera, 1)
    uncached = _shaded(renderer, LightCache(), camera, 1)
    reference = _traced(renderer, camera, 1024).color
    error, error_uncached = (np.sqrt(((c.color - reference) ** 2).mean()) for c in (cached, uncached))
    # The light of 512 paths, for one camera ray; what remains are edges of shadows and what no page saw.
    assert error < 0.25 * error_uncached
    assert abs(cached.color.mean() / reference.mean() - 1.0) < 0.02


def test_light_seen_from_one_side_is_shown_from_another(tmp_path):
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
    renderer = _opened(tmp_path, balls)
    page, camera = _page(renderer, _camera(96, 72)), Camera(look_at((4, 1.8, 5), (0, 0.7, 0)), 36, 48, 36)
    ours = _shaded(renderer, _opened_cache([page]), camera, 64)
    reference = _traced(renderer, camera, 256)
    item = find_geometry(renderer, camera).item.ravel()
    ratios = {
        name: ours.color[item == number].sum(axis=0) / reference.color[item == number].sum(axis=0)
        for number, name in enumerate(renderer.describe().items, 1)
        if name in balls
    }
    assert set(ratios) == set(balls)
    # What the page does not see is traced; what it sees may not depend on from where.
    assert {name: ratio for name, ratio in ratios.items() if np.abs(ratio - 1.0).max() > 0.04} == {}


@pytest.mark.parametrize("name", ["plastic", "roughplastic"])
def test_light_under_a_coat_seen_at_a_slant_is_shown_from_above(tmp_path, name):
    """A coat lets out a fifth less at a slant: light that is kept may not be without it."""
    table = (
        '</shape><shape type="rectangle" id="table"><transform name="to_world"><rotate x="1" angle="-90"/>'
    )
    renderer = _opened(tmp_path, {"ball": f'{table}<translate y="1.5"/></transform>{MATERIALS[name]}'})
    flat = Camera(look_at((0, 1.75, 2.5), (0, 1.5, 0)), 36, 96, 36)
    steep = Camera(look_at((0, 3.6, 0.8), (0, 1.5, 0)), 25, 32, 24)
    where = find_geometry(renderer, steep).item.ravel() == renderer.describe().items.index("table") + 1
    assert where.sum() > 200
    ours = _shaded(renderer, _opened_cache([_page(renderer, flat)]), steep, 64)
    reference = _traced(renderer, steep, 256)
    ratio = (ours.color @ LUMINANCE)[where].sum() / (reference.color @ LUMINANCE)[where].sum()
    assert abs(ratio - 1.0) < 0.03


def test_a_page_knows_its_own_pixels(diffuse):
    renderer, pages = diffuse
    page = pages[0]
    geometry = page.geometry
    image = _shaded(renderer, _opened_cache([page]), geometry.camera, 1).color.reshape(36, 48, 3)
    expected = geometry.albedo * (page.direct.color + page.indirect.color)
    # Inside surfaces; at edges a tap may be another surface, and the lamp emits.
    inside = (geometry.item == 3) | (geometry.item == 4)
    wrong = np.abs(image - expected).max(axis=2)[inside] > 0.01
    assert wrong.mean() < 0.02


def test_what_no_page_saw_is_traced(diffuse):
    renderer, pages = diffuse
    away = Camera(look_at((0, 1.5, 3), (3.5, 0.5, -1.5)), 30, 24, 18)
    cached = _shaded(renderer, _opened_cache(pages[:1]), away, 128)
    reference = _traced(renderer, away, 128)
    difference = ((cached.color - reference.color) @ LUMINANCE).mean()
    deviation = np.sqrt((cached.variance + reference.variance).sum()) / cached.variance.size
    assert abs(difference) < 4.0 * deviation + 0.01 * reference.color.mean()


def _gathered(renderer, cache: LightCache, camera: Camera, spp: int) -> list[Shading]:
    shader = Shader(renderer)
    light = Estimate(
        camera,
        np.arange(camera.width * camera.height, dtype=np.uint32),
        lambda rays, rng, square: shader.gathered(cache, rays, rng, square, pixel_angle=PIXEL_ANGLE),
        chunk=1 << 20,
        pixel_filter=PixelFilter.CENTRE,
        random=RandomKey(8, 0, Purpose.LIGHT),
        layers=2,
        is_stratified=True,
    )
    light.add(spp)
    return light.shadings


def test_light_is_gathered_as_it_is_path_traced(tmp_path):
    renderer, camera = _opened(tmp_path, MATERIALS), _camera()
    page = _page(renderer, camera)
    for cache, bias in ((LightCache(), 0.0), (_opened_cache([page]), 0.02)):
        gathered = _gathered(renderer, cache, camera, 64)
        for ours, reference in zip(gathered, (page.direct, page.indirect), strict=True):
            difference = (ours.color.reshape(-1, 3) - reference.color.reshape(-1, 3)) @ LUMINANCE
            deviation = np.sqrt((ours.variance + reference.variance.ravel()).sum())
            assert abs(difference.sum()) < 4.0 * deviation + bias * (reference.color @ LUMINANCE).sum()


def test_under_a_sky_lobes_that_send_nothing_are_counted(tmp_path):
    rows = np.linspace(0.2, 0.6, 16, dtype=np.float32)
    write_exr(tmp_path / "sky.exr", {"RGB": np.tile(rows[:, None, None], (1, 32, 3))}, is_portable=True)
    sky = '<emitter type="envmap"><string name="filename" value="sky.exr"/></emitter>'
    renderer, camera = _opened(tmp_path, {"blend": MATERIALS["blend"]}, sky), _camera()
    gathered = _gathered(renderer, LightCache(), camera, 64)
    page = _page(renderer, camera)
    for ours, reference in zip(gathered, (page.direct, page.indirect), strict=True):
        difference = (ours.color.reshape(-1, 3) - reference.color.reshape(-1, 3)) @ LUMINANCE
        deviation = np.sqrt((ours.variance + reference.variance.ravel()).sum())
        assert abs(difference.sum()) < 4.0 * deviation
        assert ours.dropped == 0


def test_metal_and_glass_have_no_diffuse_lobe(tmp_path):
    balls = {
        name: f'<bsdf type="principled"><float name="{name}" value="{share}"/></bsdf>'
        for name, share in (("metallic", 1.0), ("spec_trans", 0.75), ("roughness", 1.0))
    }
    renderer = _opened(tmp_path, balls)
    seen = find_geometry(renderer, _camera())
    names = renderer.describe().items
    albedos = [seen.albedo[seen.item == names.index(name) + 1].mean() for name in balls]
    assert albedos == pytest.approx([0.0, 0.125, 0.5], abs=0.01)


def test_light_in_a_thin_band_is_not_smoothed_away():
    geometry = geometry_of(wall(), Camera(look_at((0, 0, 4), (0, 0, 0)), 45, 32, 24))
    size = geometry.item.shape
    where = np.zeros(size, bool)
    where[11:13] = True
    light = np.random.default_rng(5).gamma(1.0, 1.0, (*size, 1)).astype(np.float32).repeat(3, axis=2)
    band = Shading(light * where[..., None], np.where(where, 1.0, 0.0).astype(np.float32))
    (found,) = smoothed([geometry], [band], where)
    assert found.color[where].std() < 0.5 * light[where].std()
    assert found.color[where].mean() == pytest.approx(light[where].mean(), rel=0.15)


def test_pages_that_count_for_nothing_make_nothing_known(diffuse):
    renderer, pages = diffuse
    finer = find_geometry(
        renderer, _camera(width=480, height=360, x=-0.5)
    )  # some points have a hair of a tap
    at = [lanes(values) for values in (positions(finer), finer.normal, finer.item)]
    page = open_page(pages[0])
    alone, filled = open_cache([page], [1.0]), open_cache([page] * 6, [1.0, *[0.0] * 5])
    np.testing.assert_array_equal(np.array(alone.find(*at)[1]), np.array(filled.find(*at)[1]))


def test_a_mirror_shows_things_as_far_behind_it(tmp_path):
    mirror = (
        '</shape><shape type="rectangle" id="mirror"><transform name="to_world"><scale value="3"/>'
        '<translate z="-1.4"/></transform><bsdf type="conductor"/>'
    )
    renderer, camera = _opened(tmp_path, {"ball": mirror}), _camera()
    seen = find_geometry(renderer, camera)
    shown = VirtualImages(renderer).reflected(seen)
    names = renderer.describe().items
    is_floor = shown.item == BEHIND + names.index("floor") + 1
    assert is_floor.sum() > 20
    points = positions(shown)[is_floor]
    # The floor, y = 0, goes on behind an upright mirror.
    np.testing.assert_allclose(points[:, 1], 0.0, atol=2e-3)
    assert points[:, 2].max() < -1.4
    last = np.flatnonzero(seen.item == names.index("mirror") + 1)[-1]  # also where lanes fill up a kernel
    assert is_floor.ravel()[last]
    is_same = shown.item == seen.item
    np.testing.assert_array_equal(shown.depth[is_same], seen.depth[is_same])


def test_rough_glass_shows_no_image(tmp_path):
    balls = {"rough": MATERIALS["roughdielectric"], "glass": MATERIALS["thindielectric"]}
    renderer, camera = _opened(tmp_path, balls), _camera()
    seen = find_geometry(renderer, camera)
    shown = VirtualImages(renderer).reflected(seen)
    rough, glass = (seen.item == renderer.describe().items.index(name) + 1 for name in balls)
    assert rough.sum() > 20
    np.testing.assert_array_equal(shown.item[rough], seen.item[rough])
    np.testing.assert_array_equal(shown.depth[rough], seen.depth[rough])
    assert (shown.item[glass] >= BEHIND).all()


def test_a_pane_shows_what_is_behind_it_where_that_is(tmp_path):
    bare, camera = _opened(tmp_path, {"ball": MATERIALS["diffuse"]}), _camera()
    behind = find_geometry(bare, camera)
    renderer = _opened(tmp_path, {"ball": _pane("front", 1.0)})
    seen, images = find_geometry(renderer, camera), VirtualImages(renderer)
    where = seen.item == renderer.describe().items.index("front") + 1
    assert where.sum() > 50
    through, mirrored = images.transmitted(seen), images.reflected(seen)
    np.testing.assert_allclose(positions(through)[where], positions(behind)[where], atol=2e-3)
    names = renderer.describe().items
    assert set(through.item[where]) == {BEHIND + names.index(name) + 1 for name in ("ball", "floor", "back")}
    # The floor before the pane goes on behind it.
    is_floor = where & (mirrored.item == BEHIND + names.index("floor") + 1)
    assert is_floor.sum() > 20
    np.testing.assert_allclose(positions(mirrored)[is_floor][:, 1], 0.0, atol=2e-3)
    assert positions(mirrored)[is_floor][:, 2].max() < 1.0
    assert (mirrored.item != through.item)[where].mean() > 0.3


@pytest.mark.parametrize(
    ("panes", "has_reflected", "has_transmitted"),
    [
        ([("front", 0.0, 1.0)], False, True),
        ([("front", 1.0, 0.0)], True, False),
        ([("front", 0.0, 1.0), ("second", 1.0, 0.0)], True, False),
        ([("front", 0.0, 1.0), ("second", 0.0, 1.0)], False, True),
    ],
)
def test_what_panes_let_through_and_what_they_reflect_is_kept_apart(
    tmp_path, panes, has_reflected, has_transmitted
):
    balls = {f"ball {k}": _pane(name, 1.0 - 0.01 * k, *shares) for k, (name, *shares) in enumerate(panes)}
    renderer, camera = _opened(tmp_path, balls), _camera()
    seen = find_geometry(renderer, camera)
    is_between = positions(seen)[..., 1] < 0.3  # there the floor between the panes may be seen
    where = ((seen.item == renderer.describe().items.index("front") + 1) & ~is_between).ravel()
    reflected, transmitted = (layer.color[where] for layer in _scattered(renderer, camera))
    assert (reflected.any(), transmitted.any()) == (has_reflected, has_transmitted)


def test_only_clear_surfaces_let_through(tmp_path):
    renderer, camera = _opened(tmp_path, MATERIALS), _camera()
    seen, (_, transmitted) = find_geometry(renderer, camera), _scattered(renderer, camera)
    names = renderer.describe().items
    clear = {names[k - 1] for k in np.unique(seen.item.ravel()[transmitted.color.any(axis=1)])}
    assert clear == {"dielectric", "thindielectric", "glowing air"}


def test_total_reflection_inside_glass_belongs_to_what_comes_through(tmp_path):
    cube = (
        '<transform name="to_world"><rotate y="1" angle="45"/><translate y="1.5" z="2"/></transform>'
        '<bsdf type="dielectric"><rgb name="specular_reflectance" value="1"/></bsdf>'
    )
    ball = f'{MATERIALS["diffuse"]}</shape><shape type="cube" id="block">{cube}'
    renderer, camera = _opened(tmp_path, {"ball": ball}), _camera()
    seen, images = find_geometry(renderer, camera), VirtualImages(renderer)
    where = seen.item == renderer.describe().items.index("block") + 1
    reflected, transmitted = (layer.spread(where | True) for layer in _scattered(renderer, camera, 64))
    assert where.mean() > 0.1
    # Seen through two faces at a right angle much is reflected by one of them, whole: 4 to 8 % is the rest.
    shares = (layer.color[where].mean() for layer in (reflected, transmitted))
    assert next(shares) < 0.25 * next(shares)
    assert (images.transmitted(seen).item[where] >= BEHIND).all()


@pytest.mark.parametrize("spp", [2, 4, 12])
def test_reflections_that_few_rays_meet_keep_their_light(tmp_path, spp):
    renderer = _opened(tmp_path, {"ball": _pane("front", 1.0)})
    camera = _camera(96, 72)
    seen, images = find_geometry(renderer, camera), VirtualImages(renderer)
    where = np.ones(seen.item.shape, bool)
    layers = [layer.spread(where) for layer in _scattered(renderer, camera, spp)]
    found = smoothed([images.reflected(seen), images.transmitted(seen)], layers, where)
    pane = seen.item == renderer.describe().items.index("front") + 1
    kept, all_of_it = (layer.color[pane].mean() for layer in (found[0], layers[0]))
    assert kept == pytest.approx(all_of_it, rel=0.02)


def test_the_sky_in_a_pane_is_smoothed(tmp_path):
    renderer, camera = _opened(tmp_path, {"ball": _pane("front", 1.0)}), _camera(96, 72)
    seen, images = find_geometry(renderer, camera), VirtualImages(renderer)
    where = np.ones(seen.item.shape, bool)
    layers = [layer.spread(where) for layer in _scattered(renderer, camera, 4)]
    mirrored = images.reflected(seen)
    reflected, _ = smoothed([mirrored, images.transmitted(seen)], layers, where)
    sky = (seen.item == renderer.describe().items.index("front") + 1) & (mirrored.item == BEHIND)
    assert sky.sum() > 200
    assert reflected.color[sky].std() < 0.5 * layers[0].color[sky].std()


def test_what_moves_along_is_averaged(diffuse):
    renderer, _ = diffuse
    rng = np.random.default_rng(4)
    frames = []
    for x in (0.0, 0.05, -0.05):
        geometry = find_geometry(renderer, _camera(x=x))
        size = geometry.item.shape
        color = rng.normal(1.0, 0.1, (*size, 3)).astype(np.float32)
        frames.append((geometry, Shading(color, np.full(size, 0.01, np.float32)), geometry.is_hit))
    pages = [open_scattered(*frame) for frame in frames]
    averaged = over_time(frames[0][0], pages[0], [(page, 1.0) for page in pages[1:]])
    where = frames[0][2]
    assert averaged[where].std() < 0.75 * frames[0][1].color[where].std()
    assert abs(averaged[where].mean() - 1.0) < 0.01
    assert not averaged[~where].any()
    # What is far from the frame's own value is no noise.
    brighter = [open_scattered(g, Shading(s.color + 5.0, s.variance), w) for g, s, w in frames[1:]]
    kept = over_time(frames[0][0], pages[0], [(page, 1.0) for page in brighter])
    np.testing.assert_allclose(kept[where], frames[0][1].color[where], atol=1e-2)


def test_what_mitsuba_prepares_late_is_no_hindrance(tmp_path):
    files = write_scene("room", tmp_path, preset="small")  # has meshes that emit
    renderer = MitsubaRenderer(files.scene, TraceSettings())
    camera = Camera(look_at((1, 1.5, 1.5), (0, 0.6, 0)), 45.0, 32, 24)
    assert _shaded(renderer, LightCache(), camera, spp=1).color.any()


def test_a_scene_opened_earlier_is_no_hindrance(tmp_path):
    shared = '</shape><bsdf type="diffuse" id="used"/><bsdf type="conductor" id="unused"/><shape type="cube">'
    balls = {"glass": '<bsdf type="dielectric"/>', "plastic": f'{shared}<ref id="used"/>'}
    camera = _camera()
    earlier = _opened(tmp_path, balls)
    alone = _shaded(earlier, LightCache(), camera, spp=4)
    renderer = _opened(tmp_path, balls)
    for opened in (renderer, earlier, renderer):
        assert (_shaded(opened, LightCache(), camera, spp=4).color == alone.color).all()


def test_paths_go_on_alike_whatever_the_chunks(tmp_path):
    renderer, camera = _opened(tmp_path, MATERIALS), _camera()
    # Of the last paths of a chunk, too, whose lanes fill up what a kernel takes.
    one, many = (_shaded(renderer, LightCache(), camera, 4, chunk=chunk) for chunk in (1 << 20, 256))
    np.testing.assert_array_equal(one.color, many.color)


def test_same_seed_same_bytes_whatever_the_chunks(diffuse):
    renderer, pages = diffuse
    camera, cache = _camera(24, 18), _opened_cache(pages)
    images = [
        _shaded(
            renderer, cache, camera, spp=4, chunk=chunk, pixel_filter=PixelFilter.GAUSSIAN
        ).color.tobytes()
        for chunk in (1 << 20, 1024)
    ]
    assert images[0] == images[1]
