"""Pages of arriving light as a cache, looked up from anywhere a path goes."""

from enfilade.irradiance.cache import (
    LightCache,
    Sight,
    known,
    light_of,
    open_cache,
    open_page,
    open_scattered,
    over_time,
    pooled,
    seen_from,
    smoothed,
)
from enfilade.irradiance.cells import Estimates
from enfilade.irradiance.shade import Shader
from enfilade.irradiance.virtual import VirtualImages

__all__ = [
    "Estimates",
    "LightCache",
    "Shader",
    "Sight",
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
