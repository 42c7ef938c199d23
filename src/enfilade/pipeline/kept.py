"""What is near a frame, and what of it is kept in memory."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import TypeVar

from enfilade.camera.path import CameraPath

T = TypeVar("T")


class Kept(OrderedDict[int, T]):
    """What was last made or asked for, by frame.

    Parameters
    ----------
    count
        How much of it.
    """

    def __init__(self, count: int) -> None:
        super().__init__()
        self._count = count

    def made(self, frame: int, make: Callable[[], T]) -> T:
        """What is kept of a frame; else it is made."""
        if frame in self:
            self.move_to_end(frame)
        else:
            self[frame] = make()
            if len(self) > self._count:
                self.popitem(last=False)
        return self[frame]


def nearest(path: CameraPath, frames: list[int], frame: int, count: int) -> list[int]:
    """The so many of some frames of a path that are nearest to one, nearest first; rests take no way."""
    here = path.distance(frame)
    return sorted(frames, key=lambda k: (abs(path.distance(k) - here), k))[:count]


def around(path: CameraPath, shot: range, frame: int, reach: int) -> list[int]:
    """Frames of a shot that show a view of their own: that of a frame, and so many to each side."""
    first, here, last = (path.distance(f) for f in (shot.start, frame, shot.stop - 1))
    return list(path.distinct_frames[max(here - reach, first) : min(here + reach, last) + 1])


def either_side(fills: list[int], frame: int) -> list[int]:
    """The last of some frames that is not after one, and the first that is not before."""
    before, after = [f for f in fills if f <= frame], [f for f in fills if f >= frame]
    return sorted({*before[-1:], *after[:1]})
