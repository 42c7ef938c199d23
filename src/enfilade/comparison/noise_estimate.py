"""Estimate of the Monte Carlo noise of a reference from its images (after Immerkaer 1996).

The difference of two Laplacians removes smooth shading. Its median absolute value in a block of 8x8 pixels
gives the standard deviation of white noise. Texture has one, too. Two properties distinguish noise:

* in an image of half the size white noise has half the deviation. Texture has about the same, since its
  energy falls with frequency;
* noise of consecutive frames is independent. Texture is correlated along the motion of the image.

Not found is noise that a denoiser or a video encoder has smoothed, noise that is the same in all frames, and
noise of a single image.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import convolve

from enfilade.comparison.motion import Moved
from enfilade.comparison.noise import NoiseEstimate
from enfilade.comparison.pairs import Pair
from enfilade.kernels.tone import srgb_decode
from enfilade.metric import Aqm, sequence_score
from enfilade.metric.transient import moved
from enfilade.records import F32
from enfilade.viewing import Viewing

MASK = (
    np.outer([1.0, -2.0, 1.0], [1.0, -2.0, 1.0]).astype(np.float32) / 6.0
)  # Immerkaer 1996; keeps deviations
MEDIAN_OF_NORMAL = 0.6745  # median absolute value of the standard normal distribution
BLOCK_PX = 8
LEAST_BLOCKS = 16  # that are not constant: fewer can't be told from texture
LEAST_SIGMA = 1e-3  # encoded: a block below is constant, or holds the rounding to 8 bits
LEAST_SHARE = 0.55  # of blocks that look noisy; texture: at most 0.50, path tracing: at least 0.58
MOST_CORRELATION = 0.15  # from frame to frame; texture: most above 0.25, path tracing: at most 0.08
MOST_FRAMES = 4  # evenly spread


class NoiseEstimator:
    """Estimates the noise of a reference from up to four of its frames.

    Parameters
    ----------
    aqm : Aqm
    viewing : Viewing
    count : int
        Number of frames of the sequence.
    """

    def __init__(self, aqm: Aqm, viewing: Viewing, count: int) -> None:
        self._aqm, self._viewing = aqm, viewing
        self._chosen = frozenset(np.linspace(min(1, count - 1), count - 1, MOST_FRAMES).astype(int).tolist())
        self._last: F32 | None = None
        self._random = np.random.default_rng(0)
        self._found: list[tuple[float, float]] = []

    def add(self, pair: Pair, motion: Moved, velocity: F32 | None) -> None:
        """Take the next frame.

        A frame without a previous one in its shot, or equal to it (a repeated pose), is skipped.

        Parameters
        ----------
        pair
        motion
            Of the reference.
        velocity : (H, W, 2) float32 or None
            Degrees per second.
        """
        if not {pair.index, pair.index + 1} & self._chosen:
            return
        image = pair.reference_grey
        last, self._last = self._last, image
        if last is None or motion.is_cut or pair.index not in self._chosen or np.array_equal(image, last):
            return
        sigma = noise_sigma(image, last, motion.backward)
        self._found.append((sigma, self._score(pair, image, sigma, velocity) if sigma else 0.0))

    def estimate(self) -> NoiseEstimate | None:
        """The noise of the frames so far; None where none had a previous one."""
        if not self._found:
            return None
        sigmas, scores = zip(*self._found, strict=True)
        return NoiseEstimate(float(np.sqrt(np.mean(np.square(sigmas)))), sequence_score(scores), len(scores))

    def _score(self, pair: Pair, image: F32, sigma: float, velocity: F32 | None) -> float:
        """Score of the frame with synthetic noise, as one of a sequence whose last frame had other noise."""
        black = np.float32(self._viewing.black_cd_m2)
        span = np.float32(self._viewing.peak_cd_m2 - self._viewing.black_cd_m2)
        noisy, before = (
            span * srgb_decode(np.clip(image + self._noise(image, sigma), 0.0, 1.0)) + black for _ in range(2)
        )
        change = noisy - before if self._aqm.has_transient else None
        return self._aqm.compare(noisy, pair.reference_cd_m2, velocity=velocity, change=change).score

    def _noise(self, image: F32, sigma: float) -> F32:
        return np.float32(sigma) * self._random.standard_normal(image.shape, np.float32)


def noise_sigma(image: F32, last: F32, backward_px: F32 | None) -> float:
    """Standard deviation of the noise of an image; 0 where nothing looks like noise.

    Parameters
    ----------
    image : (H, W) float32
        sRGB-encoded, 0..1.
    last : (H, W) float32
        The previous frame.
    backward_px : (H, W, 2) float32 or None
        From each pixel to its place in the previous frame; None: nothing moves.

    Returns
    -------
    float
        Median over the blocks that are not constant, encoded: noise is stronger in some places.
    """
    if min(image.shape) < 2 * BLOCK_PX:
        return 0.0
    residual = convolve(image, MASK)
    fine = _blocks(residual, BLOCK_PX)
    coarse = _blocks(convolve(_blocks(image, 2).mean(axis=2), MASK), BLOCK_PX // 2)
    rows, columns = coarse.shape[:2]
    fine = fine[:rows, :columns]
    # White noise of variance v has v in the fine residual and v/4 in the coarse one; texture t has t in both.
    variance = (_variance(fine) - _variance(coarse)) / 0.75
    is_varied = _variance(fine) > LEAST_SIGMA**2
    is_noisy = is_varied & (variance > 0.0)
    count = np.count_nonzero(is_varied)
    if count < LEAST_BLOCKS or np.count_nonzero(is_noisy) < LEAST_SHARE * count:
        return 0.0
    before = convolve(last, MASK)
    if backward_px is not None:  # whole pixels: interpolation would smooth noise
        before = moved(before, np.rint(backward_px))[0]
    correlation = _correlation(fine, _blocks(before, BLOCK_PX)[:rows, :columns])
    if np.median(correlation[is_noisy]) > MOST_CORRELATION:
        return 0.0
    return math.sqrt(np.median(variance[is_varied]))


def _blocks(image: F32, side: int) -> F32:
    """Whole blocks of an image, (rows, columns, side * side)."""
    rows, columns = (n // side for n in image.shape)
    whole = image[: rows * side, : columns * side].reshape(rows, side, columns, side)
    return whole.swapaxes(1, 2).reshape(rows, columns, side * side)


def _variance(blocks: F32) -> F32:
    """Variance of normal values by their median absolute value, which edges hardly change."""
    deviation = np.median(np.abs(blocks), axis=2) / MEDIAN_OF_NORMAL
    return (deviation**2).astype(np.float32)


def _correlation(one: F32, other: F32) -> F32:
    norm = np.sqrt((one**2).sum(axis=2) * (other**2).sum(axis=2))
    found: F32 = (one * other).sum(axis=2) / np.maximum(norm, np.float32(1e-12))
    return found
