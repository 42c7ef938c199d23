"""Points on the emitters of a Mitsuba scene, and where rays from them end."""

from __future__ import annotations

from typing import Any, cast

import drjit as dr
import mitsuba as mi
import numpy as np

from enfilade.arrays import Array3f, rows
from enfilade.kernels.random import one_sequence
from enfilade.kernels.tone import REC709_LUMINANCE
from enfilade.renderer import Emitters, Photons
from enfilade.scene.mitsuba.merge import MergedScene
from enfilade.scene.mitsuba.shapes import is_lamp

MAX_POINTS = 1 << 17  # on all emitters together
POINTS = 64, 1024  # fewest and most on one
SAMPLED = ("SRGBReflectanceSpectrum", "UniformSpectrum", "BitmapTexture")  # by Mitsuba, for rays of emitters
PHOTONS = 1 << 14  # from all emitters together
TEXTURE_SAMPLES, MIN_SAMPLED = 1 << 14, 0.95  # of a textured emitter, and the least part of its light


def find_emitters(merged: MergedScene) -> Emitters:
    """Distribute points over all emitting surfaces; lamps, environments and delta emitters have none."""
    numbered = zip(merged.sources, merged.scene.shapes(), strict=True)
    visible = [pair for pair in numbered if pair[1].is_emitter() and not is_lamp(pair[1])]
    shapes = [(int(source[0]), shape) for source, shape in visible]
    count = int(np.clip(MAX_POINTS // max(len(shapes), 1), *POINTS))
    sample_points = mi.Point2f(one_sequence(count).next_2d())
    points = [rows(Array3f(shape.sample_position(0.0, sample_points).p)) for _, shape in shapes]
    return Emitters(
        np.concatenate([np.zeros((0, 3), np.float32), *points]),
        np.repeat(np.array([index for index, _ in shapes], np.uint32), count),
    )


def trace_photons(scene: Any) -> Photons:
    """Follow rays from all emitters but environments to the next surface.

    There are none if Mitsuba can not sample rays of an emitter: of one whose texture is no bitmap.
    """
    if any(map(_has_pattern, scene.emitters())):
        return Photons(np.zeros((0, 3), np.float32), np.zeros(0))
    sampler = one_sequence(PHOTONS)
    points = mi.Point2f(sampler.next_2d()), mi.Point2f(sampler.next_2d())
    ray, weight, emitter = scene.sample_emitter_ray(0.0, sampler.next_1d(), *points, True)
    si = scene.ray_intersect(ray)
    flux = np.array(dr.dot(Array3f(weight), Array3f(*REC709_LUMINANCE)), np.float64)
    is_local = np.array(si.is_valid() & ~mi.has_flag(emitter.flags(), mi.EmitterFlags.Infinite))
    is_kept = is_local & np.isfinite(flux) & (flux > 0.0)
    return Photons(rows(Array3f(si.p))[is_kept], flux[is_kept])


def partly_sampled(merged: MergedScene) -> list[str]:
    """Notes on textured emitters of which Mitsuba samples a part only.

    Mitsuba chooses a point of the texture's unit square, and then a single point of the surface with these
    texture coordinates.
    """
    notes = []
    for source, shape in zip(merged.sources, merged.scene.shapes(), strict=True):
        emitter = shape.emitter()
        if emitter is None or not emitter.flags() & int(mi.EmitterFlags.SpatiallyVarying):
            continue
        name = merged.names[source[0] - 1]
        if _has_pattern(emitter):
            notes.append(
                f"the light of the emitter {name} has a texture that is no bitmap, of which Mitsuba samples "
                "no rays: paths are not guided to what emitters light most; bake the texture to a bitmap"
            )
            continue

        # Compare the light in front of the surface with what next-event estimation finds there.
        sampler, wavelengths = one_sequence(TEXTURE_SAMPLES), cast(Any, [])
        lit, point = (shape.sample_position(0.0, mi.Point2f(sampler.next_2d())) for _ in range(2))
        here = dr.zeros(mi.SurfaceInteraction3f, TEXTURE_SAMPLES)
        here.p = lit.p + lit.n * dr.norm(shape.bbox().extents())
        toward = point.p - here.p
        si = mi.SurfaceInteraction3f(point, wavelengths)
        si.sh_frame = mi.Frame3f(point.n)
        si.wi = si.to_local(-dr.normalize(toward))
        cosine = dr.maximum(si.wi.z, 0.0)
        light = shape.surface_area() * cosine * emitter.eval(si) / dr.squared_norm(toward)
        _, found = emitter.sample_direction(here, mi.Point2f(sampler.next_2d()), True)
        whole, sampled = (float(np.mean(rows(Array3f(of)) @ REC709_LUMINANCE)) for of in (light, found))
        if sampled < MIN_SAMPLED * whole:
            notes.append(
                f"Mitsuba samples {sampled / whole:.0%} of the light of the emitter "
                f"{name}, and what it lights is too dark: give it a UV map without overlaps, in the unit "
                "square of its texture"
            )
    return notes


def _has_pattern(emitter: Any) -> bool:
    """Whether the light of an emitter has a texture that is no bitmap, such as the colours of vertices."""
    textures = [node for node in mi.traverse(emitter).hierarchy if isinstance(node, mi.Texture)]
    return not all(of.class_name().startswith(SAMPLED) for of in textures)
