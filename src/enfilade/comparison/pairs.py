"""Sequences side by side: a test and one or two references, and their frames as displayed."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence as Several
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np

from enfilade.comparison.matching import (
    DEFAULT_FPS,
    Side,
    check_alike,
    common_exposure_ev,
    common_fps,
    is_exr,
    note_on_numbers,
    note_on_paths,
    note_on_seeds,
)
from enfilade.comparison.measures.displayed import DisplayedPair, on_screen
from enfilade.comparison.views import View, open_views
from enfilade.errors import ImageError
from enfilade.images import open_sequence
from enfilade.kernels.tone import luminance, srgb_encode
from enfilade.monitor import Monitor
from enfilade.records import F32
from enfilade.viewing import Viewing


@dataclass(frozen=True, eq=False)
class Pair(DisplayedPair):
    """One frame of each sequence, as the display shows them.

    Attributes
    ----------
    index : int
        From 0.
    name : str
        Of the test's frame.
    number : int
        Of the test's frame; counted from 1 where it has none of its own.
    reference_grey : (H, W) float32
        Luminance of the reference, 1 = white, encoded for an sRGB display.
    is_identical : bool
        Whether no channel of any pixel differs, before clipping and on the display.
    halves : Pair or None
        Of two references, the first as the test and the second as the reference; `reference` is their mean.
        None where there is one.
    """

    index: int
    name: str
    number: int
    reference_grey: F32
    is_identical: bool
    halves: Pair | None = None

    @property
    def squared_error(self) -> float:
        """Mean over pixels and channels, sRGB-encoded; 0 exactly where the frames are equal.

        With two references A and B, the mean of (test - A)(test - B): their independent noise averages out
        of it. It is negative where that noise hides the error.
        """
        if np.array_equal(self.test, self.reference):
            return 0.0
        against = [self.reference] if self.halves is None else [self.halves.test, self.halves.reference]
        errors = [self.test - reference for reference in against]
        return float(np.vdot(errors[0], errors[-1])) / errors[0].size


class Pairs:
    """A test and its references, of one length and size, read frame by frame, each once.

    Parameters
    ----------
    sides : sequence of Side
        The test, the reference, and a second reference where there is one.
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
    notes : tuple of str
        Remarks on the sequences, on their pairing and views, and on layers that were chosen.

    Raises
    ------
    ImageError
        They differ in length, size or frame rate, or are runs of other frames or of different exposure.
    """

    def __init__(self, sides: Several[Side], *, fps: float | None, exposure_ev: float | None) -> None:
        couples = list(combinations(sides, 2))
        for couple in couples:
            check_alike(*couple)
        self._sequences = [side.sequence for side in sides]
        self.test, self.reference = self._sequences[:2]
        if fps is None:
            fps = _first(common_fps(*couple) for couple in couples) or DEFAULT_FPS
        self.fps = fps
        if exposure_ev is None:
            exposure_ev = _first(common_exposure_ev(*couple) for couple in couples) or 0.0
        self.exposure_ev = exposure_ev
        known = [s.starts for s in self._sequences if s.starts is not None]
        self.starts = frozenset[int]().union(*known) if known else None
        pairing = (note_on_numbers(*couple) or note_on_paths(*couple) for couple in couples)
        self._views, of_views = open_views(sides)
        said = (
            *of_views,
            *pairing,
            *(note_on_seeds(*couple) for couple in couples),
            *(s.note for s in self._sequences),
        )
        self.notes = tuple(dict.fromkeys(filter(None, said)))
        self._exposures_ev = [self.exposure_ev if is_exr(s) else 0.0 for s in self._sequences]

    def __len__(self) -> int:
        return len(self.test)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self.test.width, self.test.height

    def displayed(self, viewing: Viewing, monitor: Monitor) -> Iterator[Pair]:
        """Frames as the display shows them; each is read when it is needed.

        Negative values, which no display shows, are black; a message says so once. A view of OpenColorIO
        shows them in its own way.

        Raises
        ------
        ImageError
            A frame can't be read, or holds a NaN or an infinity; or two references are equal.
        """
        is_said = False
        for index, images in enumerate(zip(*self._sequences, strict=True)):
            for image, sequence, view in zip(images, self._sequences, self._views, strict=True):
                if _checked(image, sequence.name(index)) < 0.0 and view is None and not is_said:
                    monitor.message(f"{sequence.name(index)} holds negative values, which are shown as black")
                    is_said = True
            yield self._pair(index, images, viewing)

    def _pair(self, index: int, images: Several[F32], viewing: Viewing) -> Pair:
        # Equal images stay exactly equal: all take the same steps.
        exposed = [image * np.float32(2.0**ev) for image, ev in zip(images, self._exposures_ev, strict=True)]
        test, *references = exposed
        views = self._views[0], self._views[1]
        if len(references) == 1:
            return self._of_two(index, test, references[0], viewing, views)
        first, second = references
        halves = self._of_two(index, first, second, viewing, (self._views[1], self._views[2]))
        if halves.is_identical and np.ptp(first) > 0.0:
            raise ImageError(
                f"the two references are equal in frame {halves.number} ({self.reference.name(index)}), so "
                "they are not independent; render the second one with another --seed"
            )
        pair = self._of_two(index, test, np.float32(0.5) * (first + second), viewing, views)
        is_identical = pair.is_identical and halves.is_identical
        return replace(pair, halves=halves, is_identical=is_identical)

    def _of_two(
        self, index: int, test: F32, reference: F32, viewing: Viewing, views: tuple[View | None, View | None]
    ) -> Pair:
        is_identical = np.array_equal(test, reference)
        test, reference = (
            image if view is None else view(image)
            for image, view in zip((test, reference), views, strict=True)
        )
        shown = [on_screen(image, viewing) for image in (test, reference)]
        numbers = self.test.numbers
        return Pair(
            test=shown[0][0],
            reference=shown[1][0],
            test_cd_m2=shown[0][1],
            reference_cd_m2=shown[1][1],
            index=index,
            name=self.test.name(index),
            number=index + 1 if numbers is None else numbers[index],
            reference_grey=srgb_encode(luminance(np.clip(reference, 0.0, 1.0))),
            is_identical=is_identical and np.array_equal(shown[0][0], shown[1][0]),
        )


def open_pairs(
    test: Path | str,
    references: Several[Path | str],
    *,
    fps: float | None,
    exposure_ev: float | None,
    layers: tuple[str | None, str | None] = (None, None),
) -> Pairs:
    """Open sequences to be compared.

    Parameters
    ----------
    test
        Whatever :func:`enfilade.images.open_sequence` reads.
    references
        One, or two of independent noise.
    fps, exposure_ev
        See :class:`Pairs`.
    layers
        Layer of the picture in the OpenEXR frames of the test and of the references.

    Raises
    ------
    ImageError
        One can't be read, a layer is asked for and none has layers, they differ in length, size or frame
        rate, or are runs of other frames or of different exposure.
    """
    roles = ("test", "reference", "second reference")
    sources = (test, *references)
    of_sides = (layers[0], *(layers[1] for _ in references))
    sides = [
        Side(role, source, open_sequence(source, layer=layer))
        for role, source, layer in zip(roles, sources, of_sides, strict=False)
    ]
    if any(layers) and not any(is_exr(side.sequence) for side in sides):
        raise ImageError(
            f"neither {sides[0].sequence.name(0)} nor {sides[1].sequence.name(0)} has layers; leave out "
            "--layer, which chooses one of OpenEXR frames"
        )
    if exposure_ev is not None and not any(is_exr(side.sequence) for side in sides):
        raise ImageError(
            f"{sides[0].sequence.name(0)} and {sides[1].sequence.name(0)} are shown as they are; leave out "
            "--exposure-ev, which is for OpenEXR frames"
        )
    return Pairs(sides, fps=fps, exposure_ev=exposure_ev)


def _first(values: Iterator[float | None]) -> float | None:
    """The first value that is there; all are computed, since they may raise."""
    return next((value for value in list(values) if value is not None), None)


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
