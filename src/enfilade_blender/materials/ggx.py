# SPDX-License-Identifier: GPL-3.0-or-later
"""Energy that a GGX lobe of single scattering keeps.

Blender's metals and glass add the light that is scattered several times between microfacets; Mitsuba's GGX
loses it. The loss depends on roughness, and little on direction: reflectances are scaled by its mean
(Turquin 2019, Practical multiple scattering compensation for microfacet models).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

COSINES, STEPS = 24, 48


@lru_cache(maxsize=256)
def kept_energy(alpha: float) -> float:
    """Albedo of a GGX lobe of reflectance 1 under uniform light, with Mitsuba's separable Smith term, 0..1.

    Visible normals are sampled (Heitz 2018); the weight of a sample is the shadowing of the reflected
    direction.
    """
    if alpha < 1e-3:
        return 1.0
    mu, weights = _cosines()
    return float(np.array([_albedo(m, alpha) for m in mu]) @ weights)


def metal_scale(reflectance: float, alpha: float) -> float:
    """Factor of a metal's reflectance that adds multiple scattering."""
    kept = kept_energy(round(alpha, 3))
    return 1.0 + reflectance * (1.0 - kept) / kept


@lru_cache(maxsize=256)
def mean_reflectance(alpha: float, ior: float) -> float:
    """Reflectance of a dielectric interface under uniform light, 0..1."""
    mu, weights = _cosines()
    if alpha < 1e-3:
        return float(_fresnel(mu, ior) @ weights)
    return float(np.array([_interface(m, alpha, ior)[0] for m in mu]) @ weights)


@lru_cache(maxsize=256)
def plastic_gain(alpha: float, ior: float) -> float:
    """Factor of the reflectance of Mitsuba's ``roughplastic`` that restores what its rough interface loses.

    The diffuse lobe is ``T(i) T(o) / (ior^2 (1 - R))``, with the transmittance T of single scattering and the
    internal reflectance R. With the gain, its albedo is what the interface does not reflect, as in Blender.
    """
    if alpha < 1e-3 or ior < 1.001:
        return 1.0
    mu, weights = _cosines()
    rough = np.array([_interface(m, alpha, ior)[1] for m in mu]) @ weights
    passed = 1.0 - mean_reflectance(alpha, ior)
    internal = np.array([_interface(m, alpha, 1.0 / ior)[0] for m in mu]) @ weights
    return float(passed * ior**2 * (1.0 - internal) / rough**2)


@lru_cache(maxsize=256)
def glass_gains(alpha: float, ior: float) -> tuple[float, float]:
    """Factors of the transmittance and reflectance of Mitsuba's ``roughdielectric`` that restore its losses.

    Light enters and leaves by one interface each; it is reflected on the denser side for the most part.
    """
    if alpha < 1e-3:
        return 1.0, 1.0
    mu, weights = _cosines()
    outside, inside = (
        float(np.array([sum(_interface(m, alpha, eta)) for m in mu]) @ weights) for eta in (ior, 1.0 / ior)
    )
    return (outside * inside) ** -0.5, 1.0 / min(outside, inside)


def _cosines() -> tuple[np.ndarray, np.ndarray]:
    """Cosines of directions, and their weights under uniform light."""
    mu = (np.arange(COSINES) + 0.5) / COSINES
    return mu, mu / mu.sum()


def _interface(mu: float, alpha: float, ior: float) -> tuple[float, float]:
    """Reflectance and transmittance of a rough dielectric interface of single scattering."""
    normal, out = _visible_normals(mu, alpha), np.array([np.sqrt(1.0 - mu * mu), 0.0, mu])
    cosine = np.clip(normal @ out, 0.0, 1.0)
    reflectance = _fresnel(cosine, ior)
    reflected = 2.0 * cosine[..., None] * normal - out
    inside = np.sqrt(np.maximum(1.0 - (1.0 - cosine**2) / ior**2, 0.0))
    refracted = (cosine / ior - inside)[..., None] * normal - out / ior
    up, down = reflected[..., 2], -refracted[..., 2]
    kept = np.where(up > 0.0, reflectance * _shadowing(up, alpha), 0.0)
    passed = np.where(down > 0.0, (1.0 - reflectance) * _shadowing(down, alpha), 0.0)
    return float(kept.mean()), float(passed.mean())


def _fresnel(cosine: np.ndarray, ior: float) -> np.ndarray:
    """Reflectance of a dielectric; `ior` is that of the other side over this one's."""
    sine2 = (1.0 - cosine**2) / ior**2
    other = np.sqrt(np.maximum(1.0 - sine2, 0.0))
    along = (ior * cosine - other) / np.maximum(ior * cosine + other, 1e-12)
    across = (cosine - ior * other) / np.maximum(cosine + ior * other, 1e-12)
    return np.where(sine2 >= 1.0, 1.0, 0.5 * (along**2 + across**2))


def _shadowing(cosine: np.ndarray, alpha: float) -> np.ndarray:
    """Smith's G1."""
    tangent2 = (1.0 - cosine**2) / np.maximum(cosine**2, 1e-12)
    shadowing: np.ndarray = 2.0 / (1.0 + np.sqrt(1.0 + alpha**2 * tangent2))
    return shadowing


def _albedo(mu: float, alpha: float) -> float:
    """Albedo of a lobe of reflectance 1."""
    normal, out = _visible_normals(mu, alpha), np.array([np.sqrt(1.0 - mu * mu), 0.0, mu])
    cosine = 2.0 * (normal @ out) * normal[..., 2] - out[2]
    return float(np.where(cosine > 0.0, _shadowing(cosine, alpha), 0.0).mean())


def _visible_normals(mu: float, alpha: float) -> np.ndarray:
    """Stratified normals of the microfacets that are seen from a direction, (STEPS, STEPS, 3)."""
    first, second = np.meshgrid(*[(np.arange(STEPS) + 0.5) / STEPS] * 2, indexing="ij")
    stretched = np.array([alpha * np.sqrt(1.0 - mu * mu), 0.0, mu])
    stretched /= np.linalg.norm(stretched)
    tangent = np.array([0.0, 1.0, 0.0])
    bitangent = np.cross(stretched, tangent)
    radius, angle = np.sqrt(first), 2.0 * np.pi * second
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    share = 0.5 * (1.0 + stretched[2])
    y = (1.0 - share) * np.sqrt(np.maximum(1.0 - x * x, 0.0)) + share * y
    z = np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))
    normal: np.ndarray = x[..., None] * tangent + y[..., None] * bitangent + z[..., None] * stretched
    normal[..., :2] *= alpha
    normal[..., 2] = np.maximum(normal[..., 2], 1e-9)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return normal
