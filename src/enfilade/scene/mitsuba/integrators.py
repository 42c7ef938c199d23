"""Which of Mitsuba's integrators computes what arrives along a ray."""

from __future__ import annotations

import re
from typing import Any

import mitsuba as mi

from enfilade.errors import SceneError
from enfilade.renderer import MAX_PATH_DEPTH

PATHS = {  # Mitsuba's classes that follow paths from the camera to their end; their plugins
    "PathIntegrator": "path",
    "VolumetricPathIntegrator": "volpath",
    "VolpathMisIntegratorImpl": "volpathmis",
}
POINTLIKE = (mi.EmitterFlags.DeltaPosition, mi.EmitterFlags.DeltaDirection)  # no ray meets such a light
UNLIMITED = 2**31  # edges of a path; Mitsuba says so of -1


def scene_integrator(scene: Any, max_depth: int) -> Any:
    """The scene's own integrator, else ``path``, with paths of at most so many edges; 0 leaves it as it is.

    Raises
    ------
    SceneError
        It does not compute what arrives along a ray, or knows no limit of edges.
    """
    own = scene.integrator() or mi.load_dict({"type": "path"})
    # Those for derivatives are sampling integrators by their class alone: they take other arguments.
    if not isinstance(own, mi.SamplingIntegrator) or isinstance(own, mi.CppADIntegrator):
        raise SceneError(
            f"the scene's integrator, {type(own).__name__}, can't be asked for single pixels; "
            'write <integrator type="path"/> in its place'
        )
    if not max_depth:
        return own
    if own.class_name() not in PATHS:
        raise SceneError(
            f"the scene's integrator, {own.class_name()}, has no longest path: leave --trace-max-depth out, "
            'or write <integrator type="path"/> in its place'
        )
    return _limited(own, max_depth, _limits(own)[1])


def shortened(integrator: Any, path_depth: int) -> Any:
    """The integrator for paths that have edges behind them; itself where its paths have no limit."""
    if integrator.class_name() not in PATHS:
        return integrator
    longest, roulette = _limits(integrator)
    if longest >= UNLIMITED:
        return integrator
    return _limited(integrator, max(longest - path_depth, 0), max(roulette - path_depth, 1))


def why_inseparable(scene: Any, integrator: Any) -> str:
    """Why what an integrator computes is not the light on surfaces, and nothing else; empty where it is."""
    if integrator.class_name() not in PATHS:
        return f"its integrator is {integrator.class_name()}, not a path tracer"
    if integrator.hide_emitters:
        return "its integrator hides the emitters"
    longest, _ = _limits(integrator)
    if longest < MAX_PATH_DEPTH:
        return f"its paths end after {longest} edges, fewer than {MAX_PATH_DEPTH}"
    plugin = PATHS[integrator.class_name()]
    if plugin == "path":
        return ""
    nodes = mi.traverse(scene).hierarchy
    if any(isinstance(node, mi.Medium) for node in nodes):
        return "there are media in it"
    if any(isinstance(n, mi.BSDF) and mi.has_flag(n.flags(), mi.BSDFFlags.Null) for n in nodes) and any(
        mi.has_flag(emitter.flags(), flag) for emitter in scene.emitters() for flag in POINTLIKE
    ):
        return f"its integrator, {plugin}, sees point and distant lights through masks and panes"
    return ""


def _limits(integrator: Any) -> tuple[int, int]:
    """Most edges of a path, and from which one on Russian roulette ends it."""
    found = re.search(r"max_depth = (\d+),\s*rr_depth = (\d+)", str(integrator))
    if not found:
        raise SceneError(f"{integrator.class_name()} of this Mitsuba doesn't say how long its paths are")
    return int(found[1]), int(found[2])


def _limited(integrator: Any, longest: int, roulette: int) -> Any:
    return mi.load_dict(
        {
            "type": PATHS[integrator.class_name()],
            "max_depth": longest,
            "rr_depth": roulette,
            "hide_emitters": integrator.hide_emitters,
        }
    )
