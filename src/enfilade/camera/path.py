"""The cameras of a walkthrough, its shots, and the segments between keyframes (§4.3)."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

from enfilade.camera.pinhole import Camera
from enfilade.errors import CameraPathError

REST = 3  # frames of one pose: the camera rests


@dataclass(frozen=True)
class Segment:
    """Two keyframes and the frames between them, as indices on the path (§4.3).

    Attributes
    ----------
    first, last : int
        The keyframes.
    depth : int
        Number of splits that led from an initial segment to this one.
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
        return Segment(self.first, frame, self.depth + 1), Segment(frame, self.last, self.depth + 1)


@dataclass(frozen=True, eq=False)
class CameraPath:
    """The cameras of a walkthrough; methods take and return frames as indices.

    Attributes
    ----------
    cameras : tuple of Camera
        One a frame, all of one image size.
    numbers : tuple of int
        Frame numbers as the user counts them, rising.
    fps : float
        Frames per second.
    cuts : frozenset of int
        Indices of frames that begin a new shot: no data is reused across a cut.

    Raises
    ------
    CameraPathError
        There is no camera, the cameras differ in size, the numbers do not rise, or a cut is no frame.
    """

    cameras: tuple[Camera, ...]
    numbers: tuple[int, ...]
    fps: float
    cuts: frozenset[int] = frozenset()

    def __post_init__(self) -> None:
        if not self.cameras or len(self.cameras) != len(self.numbers):
            raise CameraPathError(
                f"{len(self.cameras)} cameras with {len(self.numbers)} numbers; give a number to each of one "
                "camera or more"
            )
        if len(sizes := {(camera.width, camera.height) for camera in self.cameras}) > 1:
            raise CameraPathError(f"cameras of several image sizes, {sorted(sizes)}; give one size to all")
        for before, after in pairwise(self.numbers):  # files of frames are named by them
            if after <= before:
                raise CameraPathError(f"frame {after} follows frame {before}; the numbers must rise")
        if wrong := [cut for cut in self.cuts if cut not in range(len(self))]:
            raise CameraPathError(f"cuts at {wrong}; they are indices from 0 to {len(self) - 1}")
        plain = {"numbers": tuple(map(int, self.numbers)), "fps": float(self.fps),
                 "cuts": frozenset(map(int, self.cuts))}  # fmt: skip
        for name, value in plain.items():  # of NumPy's types, too: JSON has others
            object.__setattr__(self, name, value)

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

    def select(self, numbers: Sequence[int]) -> CameraPath:
        """A path of some frames, by their rising numbers; a cut moves to the first of them at or after it."""
        place = {number: index for index, number in enumerate(self.numbers)}
        places = [place[number] for number in numbers]
        cuts = {bisect_left(places, cut) for cut in self.cuts} - {0, len(places)}
        cameras = tuple(self.cameras[place] for place in places)
        return CameraPath(cameras, tuple(numbers), self.fps, frozenset(cuts))

    def shots(self) -> list[range]:
        """Maximal runs of frames without a cut."""
        starts = sorted({0, *self.cuts})
        return [range(a, b) for a, b in zip(starts, [*starts[1:], len(self)], strict=True)]

    def neighbours(self, frame: int) -> tuple[Camera | None, Camera | None]:
        """Cameras of the previous and the next frame; None at the ends of a shot."""
        is_first = frame == 0 or frame in self.cuts
        is_last = frame == len(self) - 1 or frame + 1 in self.cuts
        return None if is_first else self.cameras[frame - 1], None if is_last else self.cameras[frame + 1]

    @cached_property
    def distinct_frames(self) -> tuple[int, ...]:
        """Frames that do not repeat the pose of the previous frame of their shot, in order."""
        previous = [self.neighbours(frame)[0] for frame in range(len(self))]
        return tuple(f for f, p in enumerate(previous) if p is None or not p.is_same_view(self.cameras[f]))

    def static_frame(self, frame: int) -> int:
        """First frame of a repeated pose; `frame` itself if it is distinct."""
        return self.distinct_frames[self.distance(frame)]

    def distance(self, frame: int) -> int:
        """Distance along the path from the first frame, in distinct frames: repeated poses add nothing."""
        return bisect_right(self.distinct_frames, frame) - 1

    def is_at_rest(self, frame: int) -> bool:
        """Whether the pose of a frame is that of three frames or more: two are motion of half the rate."""
        place = self.distance(frame)
        following = [*self.distinct_frames[place + 1 : place + 2], len(self)][0]
        return following - self.distinct_frames[place] >= REST

    def distinct_inbetweens(self, segment: Segment) -> list[int]:
        """In-betweens of a segment without those that repeat a pose."""
        return [frame for frame in segment.inbetweens if self.static_frame(frame) == frame]

    def middle(self, segment: Segment) -> int | None:
        """Middle one of the distinct in-betweens (§4.3); None where there are none."""
        distinct = self.distinct_inbetweens(segment)
        return distinct[(len(distinct) - 1) // 2] if distinct else None

    def progress(self, segment: Segment, frame: int) -> float:
        """Distance of a distinct in-between from the first keyframe over the segment's length, in (0, 1)."""
        first, last = self.distance(segment.first), self.distance(segment.last)
        return (self.distance(frame) - first) / (last - first)
