"""Shadow rays of a Mitsuba scene, through its null interactions: cut-outs and thin glass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from enfilade.arrays import Array3f, Bool, Float, UInt
from enfilade.scene.mitsuba.shapes import has_lobe

NULL_LAYERS = 32  # null interactions along a ray before it gives up


@dataclass(frozen=True)
class Target:
    """Points of emitters, as lanes.

    Attributes
    ----------
    point : mitsuba.Point3f
    is_delta : Bool
        Whether the emitter is a point, spot or directional one, which no path can hit.
    """

    point: Any
    is_delta: Any


class ShadowRays:
    """Shadow rays. They pass null interactions, as paths do.

    Mitsuba's ``path`` leaves this light to chance, and so does not see that of emitters which no path can
    hit. Its volumetric path tracers have shadow rays that pass null interactions, to all emitters.

    Parameters
    ----------
    scene : mitsuba.Scene
    pass_to_all
        Whether shadow rays to point, spot and directional emitters pass null interactions, too.

    Attributes
    ----------
    has_null : bool
        Whether the scene has null interactions.
    """

    def __init__(self, scene: Any, *, pass_to_all: bool) -> None:
        self._scene = scene
        self._pass_to_all = pass_to_all
        self.has_null = any(
            isinstance(node, mi.BSDF) and mi.has_flag(node.flags(), mi.BSDFFlags.Null)
            for node in mi.traverse(scene).hierarchy
        )

    def is_passed(self, si: Any, bsdf: Any, is_null: Any) -> Any:
        """Whether they pass null interactions of surfaces: not those below bump and normal maps; Bool."""
        if not self.has_null:
            return Bool(False)
        passed = mi.unpolarized_spectrum(bsdf.eval_null_transmission(si, is_null))
        return Bool(is_null & (dr.max(passed) > 0.0))

    def unoccluded(
        self, si: Any, target: Target, contributions: tuple[Any, ...], active: Any
    ) -> tuple[Any, ...]:
        """Contributions (Array3f) from a point of an emitter, times the transmittance in between."""
        largest = sum((dr.max(dr.abs(of)) for of in contributions), Float(0))
        is_lit = active & ~(largest <= 0.0)  # what is not finite stays so
        share = Array3f(self._transmittance(si, target, is_lit))
        return tuple(dr.select(is_lit, of * share, 0.0) for of in contributions)

    def _transmittance(self, si: Any, to: Target, active: Any) -> Any:
        """Share of light that reaches a surface from a point; Color3f."""
        ray = si.spawn_ray_to(to.point)
        if not self.has_null:
            return mi.Color3f(dr.select(self._scene.ray_test(ray, active), 0.0, 1.0))
        nearest = self._scene.ray_intersect_preliminary(ray, coherent=False, active=active)
        is_blocked = active & nearest.is_valid()
        is_instance = dr.reinterpret_array(UInt, nearest.instance) != 0  # its BSDF is known in the loop
        is_null = is_blocked & (is_instance | has_lobe(nearest.shape.bsdf().flags(), "Null"))
        if not self._pass_to_all:
            is_null &= ~to.is_delta

        def continue_ray(ray: Any, share: Any, active: Any, layer: Any) -> tuple[Any, ...]:
            hit = self._scene.ray_intersect(ray, int(mi.RayFlags.All), Bool(True), active)
            active = active & hit.is_valid()
            passed = hit.bsdf().eval_null_transmission(hit, active)
            share = dr.select(active, share * mi.unpolarized_spectrum(passed), share)
            return hit.spawn_ray_to(to.point), share, active & (dr.max(share) > 0.0), layer + 1

        _, share, is_left, _ = dr.while_loop(
            (mi.Ray3f(ray), mi.Color3f(1.0), Bool(is_null), UInt(0)),
            lambda _ray, _share, active, layer: active & (layer < NULL_LAYERS),
            continue_ray,
            labels=("ray", "share", "active", "layer"),
        )
        return dr.select((is_blocked & ~is_null) | is_left, 0.0, share)
