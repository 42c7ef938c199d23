"""Two sequences side by side: checks that they match, and their pairs of frames as displayed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.comparison.measures.displayed import DisplayedPair
from enfilade.errors import ImageError
from enfilade.files import read_json
from enfilade.images import Sequence, open_sequence
from enfilade.kernels.tone import display_luminance, srgb_encode
from enfilade.monitor import Monitor
from enfilade.records import F32
from enfilade.viewing import Viewing

__all__ = ["Pair", "Pairs", "open_pairs"]

DEFAULT_FPS = 30.0  # where neither sequence says its own: the paper's (§6)
FPS_TOLERANCE = 2e-3  # relative: 30 and 29.97 are shown as the same


@dataclass(frozen=True, eq=False)
class Pair:
    """One frame of each sequence, as the display shows them.

    Attributes
    ----------
    index : int
        From 0.
    name : str
        Of the test's frame.
    number : int
        Of the test's frame; counted from 1 where it has none of its own.
    test, reference : (H, W) float32
        Luminance, cd/m2.
    reference_relative : (H, W) float32
        Of the reference, 1 = white.
    exposed_test, exposed_reference : (H, W, 3) float32
        Linear Rec.709 after exposure and clipping, 0..1.
    """

    index: int
    name: str
    number: int
    test: F32
    reference: F32
    reference_relative: F32
    exposed_test: F32
    exposed_reference: F32

    @property
    def squared_error(self) -> float:
        """Mean over pixels and channels, sRGB-encoded; 0 exactly where the frames are equal."""
        if np.array_equal(self.exposed_test, self.exposed_reference):
            return 0.0
        difference = srgb_encode(self.exposed_test) - srgb_encode(self.exposed_reference)
        return float(np.vdot(difference, difference)) / difference.size

    @property
    def displayed(self) -> DisplayedPair:
        """The pair for further measures."""
        test, reference = (
            srgb_encode(image).astype(np.float32) for image in (self.exposed_test, self.exposed_reference)
        )
        return DisplayedPair(test, reference, self.test, self.reference)


class Pairs:
    """Two sequences of one length and size, read frame by frame, each once.

    Parameters
    ----------
    test, reference : Sequence
    fps
        Frames per second that are shown; None takes the reference's, the test's, or 30.
    exposure_ev
        Stops, of OpenEXR frames; others are as shown. None takes that of the run folders, else 0.

    Attributes
    ----------
    test, reference : Sequence
    fps, exposure_ev : float
    starts : frozenset of int or None
        Indices of frames that begin a shot, or follow a gap in a run; None where neither is a run that
        says so.
    note : str
        Remark on the pairing of the frames, or on their content; empty where there is none.

    Raises
    ------
    ImageError
        They differ in length, size or frame rate, or are runs of other frames or of different exposure.
    """

    def __init__(
        self, test: Sequence, reference: Sequence, *, fps: float | None, exposure_ev: float | None
    ) -> None:
        _check_alike(test, reference)
        self.test, self.reference = test, reference
        self.fps = _common_fps(test, reference) if fps is None else fps
        self.exposure_ev = _common_exposure_ev(test, reference) if exposure_ev is None else exposure_ev
        known = [s.starts for s in (test, reference) if s.starts is not None]
        self.starts = frozenset[int]().union(*known) if known else None
        self.note = _note_on_numbers(test, reference)
        self._exposures_ev = [self.exposure_ev if _is_exr(s) else 0.0 for s in (test, reference)]

    def __len__(self) -> int:
        return len(self.test)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self.test.width, self.test.height

    def displayed(self, viewing: Viewing, monitor: Monitor) -> Iterator[Pair]:
        """Frames as the display shows them; each is read when it is needed.

        Negative values, which no display shows, are black; a message says so once.

        Raises
        ------
        ImageError
            A frame can't be read, or holds a NaN or an infinity.
        """
        is_said = False
        for index, images in enumerate(zip(self.test, self.reference, strict=True)):
            least = [
                _checked(image, s.name(index))
                for image, s in zip(images, (self.test, self.reference), strict=True)
            ]
            if min(least) < 0.0 and not is_said:
                first = (self.test, self.reference)[least.index(min(least))].name(index)
                monitor.message(f"{first} holds negative values, which are shown as black")
                is_said = True
            yield self._pair(index, images, viewing)

    def _pair(self, index: int, images: tuple[F32, F32], viewing: Viewing) -> Pair:
        # Equal images stay exactly equal: both take the same steps.
        exposed_test, exposed_reference = (
            np.clip(image * np.float32(2.0**ev), 0.0, 1.0)
            for image, ev in zip(images, self._exposures_ev, strict=True)
        )
        relative = [
            display_luminance(image, exposure_ev=0.0, peak_cd_m2=1.0, black_cd_m2=0.0)
            for image in (exposed_test, exposed_reference)
        ]
        span, black = np.float32(viewing.peak_cd_m2 - viewing.black_cd_m2), np.float32(viewing.black_cd_m2)
        test, reference = (image * span + black for image in relative)
        numbers = self.test.numbers
        return Pair(
            index=index,
            name=self.test.name(index),
            number=index + 1 if numbers is None else numbers[index],
            test=test,
            reference=reference,
            reference_relative=relative[1],
            exposed_test=exposed_test,
            exposed_reference=exposed_reference,
        )


def open_pairs(
    test: Path | str,
    reference: Path | str,
    *,
    fps: float | None,
    exposure_ev: float | None,
    layers: tuple[str | None, str | None] = (None, None),
) -> Pairs:
    """Open two sequences to be compared.

    Parameters
    ----------
    test, reference
        Whatever :func:`enfilade.images.open_sequence` reads.
    fps, exposure_ev
        See :class:`Pairs`.
    layers
        Layer of the picture in the OpenEXR frames of the test and of the reference.

    Raises
    ------
    ImageError
        One can't be read, a layer is asked for and none has layers, they differ in length, size or frame
        rate, or are runs of other frames or of different exposure.
    """
    sides = zip((test, reference), layers, strict=True)
    sequences = [open_sequence(source, layer=layer) for source, layer in sides]
    if any(layers) and not any(_is_exr(sequence) for sequence in sequences):
        raise ImageError(
            f"neither {sequences[0].name(0)} nor {sequences[1].name(0)} has layers; leave out --layer, which "
            "chooses one of OpenEXR frames"
        )
    pairs = Pairs(*sequences, fps=fps, exposure_ev=exposure_ev)
    pairs.note = pairs.note or _note_on_paths(test, reference)
    return pairs


def _checked(image: F32, name: str) -> float:
    least, most = float(image.min()), float(image.max())
    if np.isfinite(least) and np.isfinite(most):
        return least
    bad = ~np.isfinite(image).all(axis=2)
    row, column = np.argwhere(bad)[0].tolist()
    raise ImageError(
        f"{name} has {np.count_nonzero(bad)} pixels that are NaN or infinite, the first in row {row}, "
        f"column {column} (from 0); render it again or repair them"
    )


def _check_alike(test: Sequence, reference: Sequence) -> None:
    if test.starts is not None and reference.starts is not None:
        _check_same_frames(test, reference)
    if len(test) != len(reference):
        raise ImageError(
            f"the test has {len(test)} frames (first {test.name(0)}) and the reference {len(reference)} "
            f"(first {reference.name(0)}); give equal ones"
        )
    sizes = [f"{s.width}x{s.height}" for s in (test, reference)]
    if sizes[0] != sizes[1]:
        raise ImageError(
            f"the test's images are {sizes[0]} ({test.name(0)}) and the reference's {sizes[1]} "
            f"({reference.name(0)}); give equal ones"
        )


def _check_same_frames(test: Sequence, reference: Sequence) -> None:
    of_test, of_reference = test.numbers or (), reference.numbers or ()
    differing = set(of_test) ^ set(of_reference)
    if not differing:
        return
    number = min(differing)
    roles = (("test", test, of_test), ("reference", reference, of_reference))
    (role, has, numbers), (other, lacks, _) = roles if number in of_test else roles[::-1]
    raise ImageError(
        f"the {role}'s run has the frame {number} ({has.name(numbers.index(number))}), and the {other}'s "
        f"(first {lacks.name(0)}) does not: give runs of the same --frames, finish the one that lacks it, or "
        "give patterns of frames that both have"
    )


def _note_on_paths(test: Path | str, reference: Path | str) -> str:
    of_test, of_reference = _path_of(test), _path_of(reference)
    # Of all frames that were selected, so that those of others can't be compared. That is no reason to refuse
    # them: another host may round the same poses otherwise.
    is_known = "poses" in of_test and "poses" in of_reference
    is_alike = of_test.get("poses") == of_reference.get("poses")
    if is_alike or not is_known or of_test.get("frames") != of_reference.get("frames"):
        return ""
    return (
        f"camera: {test} and {reference} are of different camera paths (other poses in run.json): "
        "frames of one number may show different views"
    )


def _path_of(source: Path | str) -> dict[str, Any]:
    """The camera path as a run folder's ``run.json`` has it; nothing where there is none."""
    file = Path(source) / "run.json"
    found: Any = read_json(file) if file.is_file() else None
    for key in ("identity", "path"):
        found = found.get(key) if isinstance(found, dict) else None
    return found if isinstance(found, dict) else {}


def _note_on_numbers(test: Sequence, reference: Sequence) -> str:
    if test.numbers is None or reference.numbers is None or test.numbers == reference.numbers:
        return ""
    pairs = enumerate(zip(test.numbers, reference.numbers, strict=True))
    index = next(i for i, (of_test, of_reference) in pairs if of_test != of_reference)
    return (
        f"frames: their numbers differ, so they are paired in order: {test.name(index)} with "
        f"{reference.name(index)}, and so on"
    )


def _common_fps(test: Sequence, reference: Sequence) -> float:
    if test.fps and reference.fps and abs(test.fps / reference.fps - 1.0) > FPS_TOLERANCE:
        raise ImageError(
            f"the test plays at {test.fps:g} frames per second ({test.name(0)}) and the reference at "
            f"{reference.fps:g} ({reference.name(0)}); say with --fps at which both are shown"
        )
    return reference.fps or test.fps or DEFAULT_FPS


def _common_exposure_ev(test: Sequence, reference: Sequence) -> float:
    known = [s.exposure_ev for s in (test, reference) if s.exposure_ev is not None]
    if known and known[0] != known[-1]:
        raise ImageError(
            f"the test's run is shown at {known[0]:+g} stops ({test.name(0)}) and the reference's at "
            f"{known[-1]:+g} ({reference.name(0)}); say with --exposure-ev at which both are shown"
        )
    return known[0] if known else 0.0


def _is_exr(sequence: Sequence) -> bool:
    return sequence.name(0).lower().endswith(".exr")
