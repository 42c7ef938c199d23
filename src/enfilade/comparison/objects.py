"""Two renderers' images of one scene, compared object by object without their noise.

Each image is given in two halves of independent noise: what both halves share is the image, and their
difference is the noise.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from enfilade.kernels.tone import REC709_LUMINANCE
from enfilade.records import F32, F64, U32

LEAST_PIXELS = 48  # of an object: the statistics of fewer say little
HIGHLIGHT_SHARE = 0.02  # brightest pixels of an object
DARKEST = 0.01  # of the mean of all pixels: differences of darker objects are relative to this
SIGMAS = 2.0  # of the stated noise


@dataclass(frozen=True)
class ObjectDifference:
    """How an object differs between two renderers.

    Attributes
    ----------
    name : str
    shape_index : int
        0: everything.
    pixel_percent : float
        Of all pixels.
    color_percent, noise_percent : float
        Mean absolute difference of the mean colour's channels, percent of the mean, and the noise of that
        number (two standard deviations).
    brightness_percent : float
        Difference of mean luminance, percent.
    contrast_percent : float
        Difference of the standard deviation of luminance, percent of the mean.
    highlight_percent : float
        Difference of the luminance of the brightest 2 % of the pixels, percent of the mean.
    """

    name: str
    shape_index: int
    pixel_percent: float
    color_percent: float
    noise_percent: float
    brightness_percent: float
    contrast_percent: float
    highlight_percent: float

    @property
    def excess_percent(self) -> float:
        """Difference of colour beyond the noise: the order in which objects are listed."""
        return max(self.color_percent - self.noise_percent, 0.0)


def compare_objects(
    reference: Sequence[F32], test: Sequence[F32], shape_index: U32, names: Sequence[str]
) -> list[ObjectDifference]:
    """Differences of all pixels together, and of each object with enough of them.

    Parameters
    ----------
    reference, test : two (F, H, W, 3) float32
        Frames by a reference renderer and by the one under test, each in two halves; linear Rec.709.
    shape_index : (F, H, W) uint32
        Of the object at the centre of each pixel; 0: none.
    names
        Of objects 1, 2, ...

    Returns
    -------
    list of ObjectDifference
        Everything first, then objects, that with the largest difference first.
    """
    index = shape_index.ravel()
    images = [half.reshape(-1, 3).astype(np.float64) for half in (*reference, *test)]
    floor = DARKEST * float(images[0].mean() + images[1].mean()) / 2.0
    whole = _difference("everything", 0, np.arange(len(index)), len(index), images, floor)
    found = [
        _difference(name, number, pixels, len(index), images, floor)
        for number, name in enumerate(names, 1)
        if len(pixels := np.flatnonzero(index == number)) >= LEAST_PIXELS
    ]
    return [whole, *sorted(found, key=lambda of: of.excess_percent, reverse=True)]


def _difference(
    name: str,
    number: int,
    pixels: npt.NDArray[np.intp],
    total: int,
    images: Iterable[F64],
    floor: float,
) -> ObjectDifference:
    ref_a, ref_b, test_a, test_b = (image[pixels] for image in images)
    reference, test = (ref_a + ref_b) / 2.0, (test_a + test_b) / 2.0
    mean = max(float((reference @ REC709_LUMINANCE).mean()), floor, 1e-9)
    noise = np.sqrt(_variance_of_mean(ref_a - ref_b) + _variance_of_mean(test_a - test_b))
    of_ref = ref_a @ REC709_LUMINANCE, ref_b @ REC709_LUMINANCE
    of_test = test_a @ REC709_LUMINANCE, test_b @ REC709_LUMINANCE
    levels, contrasts = zip(*(_statistics(*halves) for halves in (of_ref, of_test)), strict=True)
    highlights = -_highlights(of_ref, of_test), _highlights(of_test, of_ref)

    def percent(value: float) -> float:
        return 100.0 * value / mean

    return ObjectDifference(
        name=name,
        shape_index=number,
        pixel_percent=100.0 * len(pixels) / total,
        color_percent=percent(float(np.abs(test.mean(axis=0) - reference.mean(axis=0)).mean())),
        noise_percent=percent(SIGMAS * float(noise.mean())),
        brightness_percent=percent(levels[1] - levels[0]),
        contrast_percent=percent(contrasts[1] - contrasts[0]),
        highlight_percent=percent(max(highlights, key=abs)),
    )


def _variance_of_mean(difference: F64) -> F64:
    """Variance of the mean of (A + B) / 2 by channel, from A - B (N, 3) of independent pixels."""
    result: F64 = (difference**2).sum(axis=0) / 4.0 / len(difference) ** 2
    return result


def _statistics(first: F64, second: F64) -> tuple[float, float]:
    """Mean and standard deviation of luminance in two halves (N,), without the bias of noise."""
    mean = float(first.mean() + second.mean()) / 2.0
    covariance = float(((first - first.mean()) * (second - second.mean())).mean())
    return mean, float(np.sqrt(max(covariance, 0.0)))


def _highlights(bright: tuple[F64, F64], other: tuple[F64, F64]) -> float:
    """How much brighter than other halves (N,) an image is in its brightest pixels, free of noise's bias.

    One half chooses the pixels, and the other one is compared in them.
    """
    count = max(round(HIGHLIGHT_SHARE * len(bright[0])), 1)
    mean = (other[0] + other[1]) / 2.0
    brighter = [
        float((measured - mean)[np.argpartition(chosen, -count)[-count:]].mean())
        for chosen, measured in (bright, bright[::-1])
    ]
    return sum(brighter) / 2.0
