"""Pages of arriving light as a cache, looked up from anywhere a path goes."""

from enfilade.irradiance.cache import (
    LightCache,
    known,
    light_of,
    open_cache,
    open_page,
    pooled,
    seen_from,
)
from enfilade.irradiance.cells import Estimates
from enfilade.irradiance.shade import Shader
from enfilade.irradiance.sights import open_scattered, over_time, smoothed
from enfilade.irradiance.virtual import VirtualImages

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
