"""Pages of arriving light as a cache, looked up from anywhere a path goes."""

from enfilade.methods.decoupled.cache import (
    LightCache,
    known,
    light_of,
    open_cache,
    open_page,
    pooled,
    seen_from,
)
from enfilade.methods.decoupled.cells import Estimates
from enfilade.methods.decoupled.shade import Shader
from enfilade.methods.decoupled.sights import open_scattered, over_time, smoothed
from enfilade.methods.decoupled.virtual import VirtualImages

__all__ = [
    "Estimates",
    "LightCache",
    "Shader",
    "VirtualImages",
    "known",
    "light_of",
    "open_cache",
    "open_page",
    "open_scattered",
    "over_time",
    "pooled",
    "seen_from",
    "smoothed",
]
