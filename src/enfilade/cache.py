"""A cache of the values that were used last."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import Generic, TypeVar

K = TypeVar("K")
V = TypeVar("V")

CACHED_PIXELS = 1 << 24  # of cached images: two of 3840x2160


class LruCache(Generic[K, V]):
    """The least recently used value is dropped first.

    Parameters
    ----------
    size
        Number of values.
    """

    def __init__(self, size: int) -> None:
        self._size = size
        self._values: OrderedDict[K, V] = OrderedDict()

    def get(self, key: K, make: Callable[[], V]) -> V:
        """The value of a key, made where it is not cached."""
        if key not in self._values:
            self.put(key, make())
        self._values.move_to_end(key)
        return self._values[key]

    def put(self, key: K, value: V) -> None:
        """Cache a value."""
        self._values[key] = value
        self._values.move_to_end(key)
        if len(self._values) > self._size:
            self._values.popitem(last=False)


def images_within_memory(pixels: int, most: int) -> int:
    """Number of images of a size to cache: `most`, or fewer large ones, at least one."""
    return min(max(CACHED_PIXELS // pixels, 1), most)
