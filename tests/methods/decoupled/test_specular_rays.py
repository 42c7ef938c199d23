"""Numbers of specular rays: fewer where lobes are faint."""

import pytest

from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera, look_at
from enfilade.methods.decoupled import Decoupled, specular_rays
from support.in_memory import run_passes, walk_of
from support.mitsuba_scene import opened, placed, rgb, write

SIZE = 32, 24
PATH = CameraPath((Camera(look_at((0, 0, 4), (0, 0, 0)), 40, *SIZE),), (1,), 24.0)
GLOSS = f'<bsdf type="roughplastic">{rgb("diffuse_reflectance", 0.5)}<float name="alpha" value="0.3"/></bsdf>'
METAL = '<bsdf type="roughconductor"><float name="alpha" value="0.3"/></bsdf>'


@pytest.mark.slow
@pytest.mark.parametrize(("bsdf", "share"), [(GLOSS, 2 / 8), (METAL, 1.0)])
def test_faint_lobes_have_a_quarter_of_the_rays(tmp_path, monkeypatch, bsdf, share):
    walk = walk_of(
        PATH,
        opened(write(tmp_path, placed("rectangle", "wall", (0, 0, 0), bsdf, 8))),
        decoupled={"specular_spp": 8},
    )

    def run():
        results = run_passes(Decoupled(), walk)
        return results.colors[0], results.metadata("shading", 0)["rays"]["specular"]

    color, rays = run()
    monkeypatch.setattr(specular_rays, "FAINT", 0.0)
    whole, all_rays = run()
    assert rays / all_rays == pytest.approx(share, rel=0.02)
    assert color.mean() == pytest.approx(whole.mean(), rel=0.002)
