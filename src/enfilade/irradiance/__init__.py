"""Keyframes as a cache of the light that arrives, looked up from anywhere a path goes."""

from enfilade.irradiance.cache import LightCache, open_cache
from enfilade.irradiance.shade import shade

__all__ = ["LightCache", "open_cache", "shade"]
