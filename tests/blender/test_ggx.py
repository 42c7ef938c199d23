"""Energy of GGX lobes, against Mitsuba's own."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from enfilade_blender.materials.ggx import (
    glass_gains,
    kept_energy,
    mean_reflectance,
    metal_scale,
    plastic_gain,
)

SAMPLES = 100_000


def albedo(content, component=None):
    """Albedo of a BSDF under uniform light, from above."""
    bsdf = mi.load_dict(content)
    context = mi.BSDFContext()
    if component is not None:
        context.type_mask = int(component)
    rng = np.random.default_rng(1)
    u = rng.random((4, SAMPLES), np.float32)
    mu = mi.Float(np.sqrt(u[0]))  # directions weighted by their cosine
    si = dr.zeros(mi.SurfaceInteraction3f, SAMPLES)
    si.wi = mi.Vector3f(dr.sqrt(1.0 - mu * mu), 0.0, mu)
    _, weight = bsdf.sample(context, si, mi.Float(u[1]), mi.Point2f(u[2], u[3]))
    return float(dr.mean(weight.x)[0])


@pytest.mark.parametrize("alpha", [0.02, 0.25, 1.0])
def test_a_rough_mirror_keeps_the_energy_that_mitsuba_keeps(alpha):
    mirror = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": alpha}
    assert kept_energy(alpha) == pytest.approx(albedo(mirror), abs=0.01)  # noise of 1e5 samples: 0.002


@pytest.mark.parametrize(("alpha", "ior"), [(0.09, 1.45), (0.36, 1.5), (0.25, 1.8)])
def test_rough_plastic_with_the_gain_has_the_albedo_below_a_smooth_interface(alpha, ior):
    plastic = {
        "type": "roughplastic",
        "distribution": "ggx",
        "alpha": alpha,
        "int_ior": ior,
        "ext_ior": 1.0,
        "diffuse_reflectance": {"type": "rgb", "value": 0.3},
    }
    reflected = albedo(plastic, mi.BSDFFlags.Diffuse)
    wanted = 0.3 * (1.0 - albedo(plastic, mi.BSDFFlags.Glossy))
    # Mitsuba interpolates its transmittance in a table of 64 directions.
    assert plastic_gain(alpha, ior) * reflected == pytest.approx(wanted, rel=0.03)


@pytest.mark.parametrize("alpha", [0.16, 0.36, 1.0])
def test_a_ball_of_rough_glass_keeps_the_light_around_it(alpha):
    gains = zip(("transmittance", "reflectance"), glass_gains(alpha, 1.45), strict=True)
    tints = {f"specular_{name}": {"type": "rawconstant", "value": [gain] * 3} for name, gain in gains}
    kind = {"type": "roughdielectric", "distribution": "ggx"}
    glass = kind | {"alpha": alpha, "int_ior": 1.45, "ext_ior": 1.0} | tints
    film = {"type": "hdrfilm", "width": 32, "height": 32, "rfilter": {"type": "box"}}
    eye = mi.ScalarTransform4f().look_at([0, 0, 10], [0, 0, 0], [0, 1, 0])
    scene = {
        "type": "scene",
        "ball": {"type": "sphere", "bsdf": glass},
        "light": {"type": "constant"},
        "sensor": {"type": "orthographic", "to_world": eye, "film": film},
        "integrator": {"type": "path", "max_depth": 30, "rr_depth": 30},
    }
    image = np.array(mi.render(mi.load_dict(scene), spp=64, seed=1))[..., 0]
    x = (np.arange(32) - 15.5) / 16.0
    seen = image[x[:, None] ** 2 + x**2 < 1.0].mean()
    # 0.90, 0.70 and 0.34 without the gains. With them a cube, which has more reflections inside, has 0.98.
    assert seen == pytest.approx(1.0, abs=0.07)


def test_smooth_surfaces_need_no_gain():
    assert glass_gains(0.0, 1.5) == (1.0, 1.0)
    assert kept_energy(0.0) == plastic_gain(0.0, 1.5) == metal_scale(0.9, 0.0) == 1.0


def test_a_white_metal_gets_all_lost_energy_back():
    assert metal_scale(1.0, 0.49) * kept_energy(0.49) == pytest.approx(1.0)


def test_the_mean_reflectance_of_glass():
    assert mean_reflectance(0.0, 1.5) == pytest.approx(
        0.0918, abs=2e-4
    )  # d'Eon 2021, diffuse Fresnel reflectance
