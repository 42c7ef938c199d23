"""Shadow rays of a Mitsuba scene, through null interactions where its integrator passes them."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from enfilade.arrays import Array3f, Bool, Float, UInt

NULL_LAYERS = 32  # null interactions along a ray before it gives up


class ShadowRays:
    """Shadow rays.

    Parameters
    ----------
    scene : mitsuba.Scene
    pass_null
        Whether they pass null interactions, such as cut-outs, as those of Mitsuba's volumetric path tracers.

    Attributes
    ----------
    pass_null : bool
    """

    def __init__(self, scene: Any, *, pass_null: bool) -> None:
        self._scene = scene
        self.pass_null = pass_null

    def unoccluded(
        self, si: Any, target: Any, contributions: tuple[Any, ...], active: Any
    ) -> tuple[Any, ...]:
        """Contributions (Array3f) from a point of an emitter, times the transmittance in between."""
        largest = sum((dr.max(dr.abs(of)) for of in contributions), Float(0))
        is_lit = active & ~(largest <= 0.0)  # what is not finite stays so
        share = Array3f(self._transmittance(si, target, is_lit))
        return tuple(dr.select(is_lit, of * share, 0.0) for of in contributions)

    def _transmittance(self, si: Any, target: Any, active: Any) -> Any:
        """Share of light that reaches a surface from a point; Color3f."""
        ray = si.spawn_ray_to(target)
        is_blocked = self._scene.ray_test(ray, active)
        if not self.pass_null:
            return mi.Color3f(dr.select(is_blocked, 0.0, 1.0))

        def continue_ray(ray: Any, share: Any, active: Any, layer: Any) -> tuple[Any, ...]:
            hit = self._scene.ray_intersect(ray, int(mi.RayFlags.All), Bool(True), active)
            active = active & hit.is_valid()
            passed = hit.bsdf().eval_null_transmission(hit, active)
            share = dr.select(active, share * mi.unpolarized_spectrum(passed), share)
            return hit.spawn_ray_to(target), share, active & (dr.max(share) > 0.0), layer + 1

        _, share, is_blocked, _ = dr.while_loop(
            (mi.Ray3f(ray), mi.Color3f(1.0), Bool(active & is_blocked), UInt(0)),
            lambda _ray, _share, active, layer: active & (layer < NULL_LAYERS),
            continue_ray,
            labels=("ray", "share", "active", "layer"),
        )
        return dr.select(is_blocked, 0.0, share)
