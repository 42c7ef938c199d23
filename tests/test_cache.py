"""The cache of values that were used last, and how many images it holds."""

import pytest

from enfilade.cache import LruCache, images_within_memory


def test_the_least_recently_used_value_is_dropped():
    cache: LruCache[str, int] = LruCache(2)
    made = [cache.get(key, lambda key=key: ord(key)) for key in "abacb"]
    assert made == [ord(key) for key in "abacb"]
    assert cache.get("c", lambda: 0) == ord("c")
    assert cache.get("a", lambda: 0) == 0  # "b" took its place


@pytest.mark.parametrize(
    ("size", "count"), [((320, 180), 4), ((1920, 1080), 4), ((3840, 2160), 2), ((7680, 4320), 1)]
)
def test_fewer_large_images_are_cached(size, count):
    assert images_within_memory(size[0] * size[1], 4) == count
