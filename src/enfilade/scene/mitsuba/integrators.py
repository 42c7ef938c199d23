"""Mitsuba's integrators: the one that a scene has, with a limit of the path depth."""

from __future__ import annotations

import re
from typing import Any

import mitsuba as mi
import numpy as np

from enfilade.errors import SceneError
from enfilade.renderer import MAX_PATH_DEPTH, UNLIMITED

PATH_TRACERS = {  # Mitsuba's classes that trace paths from the camera to their end; their plugins
    "PathIntegrator": "path",
    "VolumetricPathIntegrator": "volpath",
    "VolpathMisIntegratorImpl": "volpathmis",
}
POLARIZING = ("CircularPolarizer", "LinearPolarizer", "LinearRetarder", "MeasuredPolarized")
# Rays start this far from a surface: times one and the largest coordinate there, as Mitsuba moves them.
RAY_OFFSET = 1500 * 2.0**-24
# Of the scene's diagonal. A unit cube has its contact shadow 1000 units from the origin, not at 10,000.
LARGEST_OFFSET = 2e-4
NEAR_SHARE = 0.01  # of the scene's diagonal: what is nearer than that is hardly ever in sight


def scene_integrator(scene: Any, max_depth: int) -> Any:
    """The scene's own integrator, else ``path``, limited to a path depth; 0 leaves its own limit.

    Raises
    ------
    SceneError
        It does not compute the radiance along single rays, or has no limit of the path depth.
    """
    own = _innermost(scene.integrator() or mi.load_dict({"type": "path"}))
    # Differentiable integrators are sampling integrators by class, but take other arguments.
    if not isinstance(own, mi.SamplingIntegrator) or isinstance(own, mi.CppADIntegrator):
        raise SceneError(
            f"the scene's integrator, {type(own).__name__}, can't render single pixels; "
            'write <integrator type="path"/> in its place'
        )
    if own.class_name() not in PATH_TRACERS:
        if not max_depth:
            return own
        raise SceneError(
            f"the scene's integrator, {own.class_name()}, has no limit of the path depth: leave "
            '--max-depth out, or write <integrator type="path"/> in its place'
        )
    # Where camera rays pass hidden emitters (`Shapes`), the integrator need not.
    hides = own.hide_emitters and has_media(scene)
    if not max_depth and hides == own.hide_emitters:
        return own
    depth, rr_depth = _depths(own)
    return _limited(own, max_depth or depth, rr_depth, hides_emitters=hides)


def hides_emitters(scene: Any) -> bool:
    """Whether the camera does not see a scene's emitters."""
    own = scene.integrator()
    return own is not None and bool(getattr(_innermost(own), "hide_emitters", False))


def _innermost(integrator: Any) -> Any:
    """The only integrator in one that writes AOVs or moments of it; others themselves."""
    if integrator.class_name() not in ("AOVIntegrator", "MomentIntegrator"):
        return integrator
    _, *nested = (node for node in mi.traverse(integrator).hierarchy if isinstance(node, mi.Integrator))
    return nested[0] if len(nested) == 1 else integrator


def shortened(integrator: Any, path_depth: int, end_depth: int | None = None) -> Any:
    """The integrator for rays that continue paths of a depth; itself if its paths have no limit.

    With `end_depth` paths end as those of that depth do, while Russian roulette is the same.
    """
    ends = path_depth if end_depth is None else end_depth
    if integrator.class_name() not in PATH_TRACERS:
        return integrator
    max_depth, rr_depth = _depths(integrator)
    if max_depth >= UNLIMITED:
        return integrator
    return _limited(integrator, max(max_depth - ends, 0), max(rr_depth - path_depth, 1))


def max_path_depth(integrator: Any) -> int:
    """Greatest depth of the paths of a path tracer; :data:`UNLIMITED` without a limit."""
    return min(_depths(integrator)[0], UNLIMITED)


def why_inseparable(scene: Any, integrator: Any) -> str:
    """Reason why an integrator's radiance is not the sum of emission and lobes; empty if it is."""
    if integrator.class_name() not in PATH_TRACERS:
        return f"its integrator is {integrator.class_name()}, not a path tracer"
    max_depth, _ = _depths(integrator)
    if max_depth <= MAX_PATH_DEPTH:
        return f"its paths end at depth {max_depth} (--max-depth {MAX_PATH_DEPTH + 1} or more continues them)"
    if is_volumetric(integrator) and has_media(scene):
        return "it has participating media"
    return ""


def limitations(scene: Any, integrator: Any) -> list[str]:
    """Notes on parts of a scene that frames do not show, or not as Mitsuba would.

    Lenses and clipping of its sensors, media, some emitters, polarization, contacts far from the origin.
    """
    box = scene.bbox()
    diagonal, farthest = float(np.linalg.norm(box.extents())), float(np.abs([box.min, box.max]).max())
    notes = [
        f"the scene's sensor is a {sensor.class_name()}: every frame is the perspective image of a pinhole"
        for sensor in scene.sensors()
        if sensor.class_name() != "PerspectiveCamera"
    ]
    for sensor in scene.sensors():
        if not isinstance(sensor, mi.ProjectiveCamera):
            continue
        near, far = sensor.near_clip(), sensor.far_clip()
        if near > NEAR_SHARE * diagonal or far < diagonal:
            notes.append(
                f"the scene's sensor shows distances of {near:g} to {far:g} alone (near_clip, far_clip): "
                f"frames show all of the scene, which measures {diagonal:.3g}"
            )
    notes += [
        f"the emitter of {emitter.get_shape().id()} is a directionalarea, whose light Mitsuba's path tracers "
        "never find; use an area or a directional emitter"
        for emitter in scene.emitters()
        if emitter.class_name() == "DirectionalArea"
    ]
    offset = RAY_OFFSET * (1.0 + farthest)
    if offset > LARGEST_OFFSET * diagonal:
        notes.append(
            f"rays start {offset:.2g} units from surfaces, since coordinates reach {farthest:.3g} and the "
            f"scene measures {diagonal:.3g}: shadows of what is nearer are lost; move it to the origin, or "
            "enlarge it"
        )
    if {node.class_name() for node in mi.traverse(scene).hierarchy}.intersection(POLARIZING):
        notes.append("light has no polarization here: polarizers and retarders do not show their effect")
    if not is_volumetric(integrator):
        if has_media(scene):
            notes.append(
                "the scene has participating media, which its integrator ignores: "
                '<integrator type="volpath"/> and --method reference show them'
            )
    elif scene.sensors() and scene.sensors()[0].get_medium() is not None:
        notes.append("the camera is taken to be in the medium of the scene's first sensor in all frames")
    return notes


def has_media(scene: Any) -> bool:
    """Whether a scene has participating media."""
    return any(isinstance(node, mi.Medium) for node in mi.traverse(scene).hierarchy)


def is_volumetric(integrator: Any) -> bool:
    """Whether an integrator is a volumetric path tracer: its shadow rays pass null interactions."""
    return PATH_TRACERS.get(integrator.class_name(), "path") != "path"


def _depths(integrator: Any) -> tuple[int, int]:
    """Greatest path depth, and the depth at which Russian roulette begins."""
    found = re.search(r"max_depth = (\d+),\s*rr_depth = (\d+)", str(integrator))
    if not found:
        raise SceneError(f"{integrator.class_name()} of this Mitsuba does not print its path depth")
    return int(found[1]), int(found[2])


def _limited(integrator: Any, max_depth: int, rr_depth: int, *, hides_emitters: bool = False) -> Any:
    return mi.load_dict(
        {
            "type": PATH_TRACERS[integrator.class_name()],
            "max_depth": max_depth if max_depth < UNLIMITED else -1,
            "rr_depth": rr_depth,
            "hide_emitters": hides_emitters,
        }
    )
