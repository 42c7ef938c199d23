"""Rooms that a lamp in an opaque shade lights: most light leaves through the small opening."""

import json

import numpy as np
import pytest

from enfilade.arrays import lanes, rows
from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera, look_at
from enfilade.gbuffer import find_geometry
from enfilade.kernels.random import one_sequence
from enfilade.kernels.rays import camera_rays, pixel_centres
from enfilade.methods.decoupled import Decoupled, guiding, prepass
from enfilade.methods.decoupled.guiding import Regions, find_regions
from enfilade.methods.decoupled.integrator import Integrator
from enfilade.renderer import Purpose, RandomKey
from support.in_memory import run_passes, walk_of
from support.mitsuba_scene import SKY, opened, rgb, write

SIZE = (64, 48)
HEAD = '<scene version="3.0.0"><integrator type="path"/>'
WALL, WHITE = (
    f'<bsdf type="twosided"><bsdf type="diffuse">{rgb("reflectance", of, of, of)}</bsdf></bsdf>'
    for of in (0.7, 0.85)
)
ROOM = f"""<shape type="cube"><transform name="to_world"><scale x="2" y="2" z="1.5"/>
<translate z="1.5"/></transform>{WALL}</shape>"""
SHADE = f"""<shape type="cylinder"><float name="radius" value="0.12"/><point name="p0" x="0" y="0" z="1.85"/>
<point name="p1" x="0" y="0" z="2.1"/>{WHITE}</shape><shape type="disk"><transform name="to_world">
<scale value="0.12"/><translate z="2.1"/></transform>{WHITE}</shape>"""
LAMP = f"""<shape type="sphere"><float name="radius" value="0.05"/><point name="center" x="0" y="0" z="2"/>
<emitter type="area">{rgb("radiance", 100, 100, 100)}</emitter></shape>"""
SHADED = (ROOM, SHADE, LAMP)


def camera(x=0.0):
    return Camera(look_at((x, -1.9, 1.0), (0, 0, 0.8), (0, 0, 1)), 80.0, *SIZE)


def opened_room(folder, *shapes, sky="", **settings):
    return opened(write(folder, *shapes, head=HEAD, sky=sky), **settings)


def regions_in(renderer):
    geometry = find_geometry(renderer, camera())
    probe = Integrator(renderer).kernels.probe
    return find_regions(renderer.photons(), probe, geometry, RandomKey(0, 0, Purpose.GUIDING))[0]


def test_the_shade_is_found(tmp_path):
    regions = regions_in(opened_room(tmp_path, *SHADED))
    x, y, z, radius = regions.spheres.T
    assert np.all(np.hypot(x, y) < 0.13)
    assert np.all((z > 1.84) & (z < 2.11))
    assert np.all((radius > 0.0) & (radius < 0.3))
    below, above = regions.radiance[:, :4].mean(), regions.radiance[:, 4:].mean()
    assert below > 10.0 * above  # the shade is closed at its top


def test_regions_are_stored_as_json():
    regions = Regions(np.random.default_rng(1).random((3, 4)), np.random.default_rng(2).random((3, 8)), 0.25)
    found = Regions.from_json(json.loads(json.dumps(regions.to_json())))
    for name in ("spheres", "radiance", "background"):
        np.testing.assert_array_equal(getattr(found, name), getattr(regions, name))
    assert Regions.from_json([]) is None


def test_open_lamps_and_the_sky_need_no_guide(tmp_path):
    assert regions_in(opened_room(tmp_path, ROOM, LAMP)) is None
    assert regions_in(opened_room(tmp_path, SHADE, sky=SKY)) is None


def test_a_guide_changes_no_mean_and_reduces_the_noise(tmp_path):
    guide = regions_in(opened_room(tmp_path, *SHADED)).upload()
    renderer = opened_room(tmp_path, *SHADED, max_depth=3)  # of longer paths the first bounce alone is guided
    pixels = np.repeat(np.arange(40 * 64, 48 * 64, dtype=np.uint32), 4096)  # of the floor
    point = renderer.intersect(camera_rays(camera(), pixel_centres(camera(), lanes(pixels))))

    def indirect(guide):
        found = renderer.estimate_diffuse(point, one_sequence(len(pixels)), guide=guide)[1]
        return rows(found)[:, 0].astype(float)

    plain, guided = indirect(None), indirect(guide)
    error = np.hypot(plain.std(), guided.std()) / np.sqrt(len(pixels))
    assert guided.mean() == pytest.approx(plain.mean(), abs=4.0 * error)
    assert error < 0.03 * plain.mean()
    assert guided.var() < 0.5 * plain.var()


def test_final_gathering_is_guided(tmp_path, monkeypatch):
    renderer = opened_room(tmp_path, *SHADED)
    path = CameraPath(tuple(camera(x) for x in (-0.1, 0.0, 0.1)), (1, 2, 3), 24.0)

    def noise():
        walk = walk_of(path, renderer, decoupled={"denoiser": "none", "irradiance_spp": 32})
        results = run_passes(Decoupled(), walk)
        guide_paths = results.metadata("prepass", 0)["rays"]["path_guide"]
        return results.record("irradiance", 0).indirect.variance.mean(), guide_paths

    guided, guide_paths = noise()
    assert guide_paths >= guiding.PIXELS * (guiding.PATHS + guiding.MORE_PATHS)
    monkeypatch.setattr(prepass, "find_regions", lambda *_: (None, 0))
    plain, guide_paths = noise()
    assert guided < 0.5 * plain
    assert guide_paths == 0
