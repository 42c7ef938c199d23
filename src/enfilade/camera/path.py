"""The cameras of a walkthrough, its shots, and the segments between keyframes (§4.3)."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property

from enfilade.camera.pinhole import Camera


@dataclass(frozen=True)
class Segment:
    """Two keyframes and the frames between them, as indices on the path (§4.3).

    Attributes
    ----------
    first, last : int
        The keyframes.
    depth : int
        How often an initial segment was split to make this one.
    """

    first: int
    last: int
    depth: int = 0

    @property
    def inbetweens(self) -> range:
        """Frames that are neither keyframe."""
        return range(self.first + 1, self.last)

    def split(self, frame: int) -> tuple[Segment, Segment]:
        """Two halves that share a frame."""
        return (
            Segment(self.first, frame, self.depth + 1),
            Segment(frame, self.last, self.depth + 1),
        )


@dataclass(frozen=True, eq=False)
class CameraPath:
    """The cameras of a walkthrough.

    Attributes
    ----------
    cameras : tuple of Camera
        One a frame; all of one image size.
    numbers : tuple of int
        The number by which the user knows each frame, rising.
    fps : float
        Frames per second.
    cuts : frozenset of int
        Indices of frames that begin a new shot: nothing is carried across.
    """

    cameras: tuple[Camera, ...]
    numbers: tuple[int, ...]
    fps: float
    cuts: frozenset[int] = frozenset()

    def __post_init__(self) -> None:
        if len(self.cameras) != len(self.numbers):
            raise ValueError(f"{len(self.cameras)} cameras with {len(self.numbers)} numbers")

    def __len__(self) -> int:
        return len(self.cameras)

    @property
    def width(self) -> int:
        """Pixels."""
        return self.cameras[0].width

    @property
    def height(self) -> int:
        """Pixels."""
        return self.cameras[0].height

    def neighbours(self, frame: int) -> tuple[Camera | None, Camera | None]:
        """Cameras of the previous and the next frame; None at the ends of a shot."""
        previous = None if frame == 0 or frame in self.cuts else self.cameras[frame - 1]
        is_last = frame == len(self) - 1 or frame + 1 in self.cuts
        return previous, None if is_last else self.cameras[frame + 1]

    def original(self, frame: int) -> int:
        """First frame of the run of equal views to which a frame belongs: itself where it moves."""
        return self._originals[frame]

    @cached_property
    def _originals(self) -> list[int]:
        found: list[int] = []
        for frame, camera in enumerate(self.cameras):
            rests = frame > 0 and frame not in self.cuts and camera.is_same_view(self.cameras[frame - 1])
            found.append(found[-1] if rests else frame)
        return found

    @cached_property
    def originals(self) -> tuple[int, ...]:
        """Frames that show a view of their own, in order: those that are no copies."""
        return tuple(frame for frame in range(len(self)) if self.original(frame) == frame)

    def place(self, frame: int) -> int:
        """How many other views come before a frame's: how far it is along the path, rests left out."""
        return self._places[frame]

    @cached_property
    def _places(self) -> list[int]:
        moves = [int(original == frame) for frame, original in enumerate(self._originals)]
        return [place - 1 for place in itertools.accumulate(moves)]

    def moving(self, segment: Segment) -> list[int]:
        """The in-betweens of a segment that show a view of their own: those that are no copies."""
        return [frame for frame in segment.inbetweens if self.original(frame) == frame]

    def middle(self, segment: Segment) -> int | None:
        """The in-between that stands for a segment (§4.3): the middle one of those that move."""
        moving = self.moving(segment)
        return moving[(len(moving) - 1) // 2] if moving else None

    def progress(self, segment: Segment, frame: int) -> float:
        """Where the view of a frame that moves lies between those of a segment's keyframes, in (0, 1)."""
        first, last = self.place(segment.first), self.place(segment.last)
        return (self.place(frame) - first) / (last - first)

    def shots(self) -> list[range]:
        """Runs of frames without a cut between them."""
        starts = sorted({0, *self.cuts})
        return [range(a, b) for a, b in zip(starts, [*starts[1:], len(self)], strict=True)]
