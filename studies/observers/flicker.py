"""Flicker against blur: scores of flickering errors and of a steady blur (three synthetic examples).

These are not measurements of observers. They test a common experience with rendered animation: of two
sequences with the same mean squared error, the flickering one looks worse. In each example the blur has the
larger squared error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import scipy.ndimage

from enfilade.metric import SequenceAqm, sequence_score
from enfilade.monitor import Monitor
from enfilade.records import F32, F64
from studies.observers.mode import Mode
from studies.observers.screen import screen
from studies.progress import counted

SIZE_PX = 256
PIXELS_PER_DEGREE = 28.0
FPS = 30.0
FRAMES = 6
MEAN_CD_M2 = 40.0
BLUR_PX = 1.0
PAN_PX = 3  # a frame, in the third example
SHARE = 0.9  # of the blur's squared error: the squared error of the flicker


@dataclass(frozen=True)
class Pair:
    """Scores of one example.

    Attributes
    ----------
    flicker_jnd, blur_jnd : float
        Of the sequence with the flickering error, and of the blurred one.
    """

    flicker_jnd: float
    blur_jnd: float

    @property
    def ratio(self) -> float:
        """Ratio of the scores; above 1 where the flicker is scored worse."""
        return self.flicker_jnd / self.blur_jnd


def _scene() -> F64:
    """Cloudy texture with sharp-edged discs, cd/m2, periodic."""
    random = np.random.default_rng(20)
    fx, fy = np.fft.rfftfreq(SIZE_PX), np.fft.fftfreq(SIZE_PX)[:, None]
    spectrum = np.fft.rfft2(random.standard_normal((SIZE_PX, SIZE_PX)))
    cloud = np.fft.irfft2(spectrum / np.maximum(np.hypot(fx, fy), 1.0 / SIZE_PX), s=(SIZE_PX, SIZE_PX))
    scene: F64 = MEAN_CD_M2 * (1.0 + 0.2 * cloud / cloud.std())
    y, x = np.mgrid[:SIZE_PX, :SIZE_PX]
    for centre_x, centre_y, level in ((70, 80, 1.5), (170, 110, 0.6), (120, 190, 1.3)):
        scene = np.where(np.hypot(x - centre_x, y - centre_y) < 28.0, level * scene, scene)
    bright: F64 = np.maximum(scene, 1.0)
    return bright


def _blurred(scene: F64) -> F64:
    blurred: F64 = scipy.ndimage.gaussian_filter(scene, BLUR_PX, mode="wrap")
    return blurred


def _shimmer(frame: int, scene: F64) -> F64:
    """Edges that alternate between two positions a fraction of a pixel apart."""
    sign = 1.0 if frame % 2 else -1.0
    return sign * (np.roll(scene, 1, axis=1) - np.roll(scene, -1, axis=1))


def _boil(frame: int, scene: F64) -> F64:
    """Noise of the scene's contrast, independent in each frame."""
    noise = np.random.default_rng(frame).standard_normal(scene.shape)
    return scene * scipy.ndimage.gaussian_filter(noise, 1.0, mode="wrap")


def _pump(frame: int, scene: F64) -> F64:
    """Patches that are brightened and darkened in alternate frames."""
    y, x = np.mgrid[:SIZE_PX, :SIZE_PX] // 32
    return np.where((x + y + frame) % 2 == 0, scene, -scene)


Error: TypeAlias = Callable[[int, F64], F64]
EXAMPLES: dict[str, tuple[Error, int]] = {  # error of a frame, pan in pixels a frame
    "shimmering edges": (_shimmer, 0),
    "flashing patches": (_pump, 0),
    "boiling noise in a pan": (_boil, PAN_PX),
}


def sequences(example: str) -> list[tuple[F32, F32, F32]]:
    """Frames of an example: the reference, the one with a flickering error, and the blurred one.

    Parameters
    ----------
    example : str
        One of EXAMPLES.

    Returns
    -------
    list of three (256, 256) float32
        cd/m2. The flicker's mean squared error is 0.9 times that of the blur, in each frame.
    """
    error, pan_px = EXAMPLES[example]
    static_scene = _scene()
    found = []
    for frame in range(FRAMES):
        scene = np.roll(static_scene, frame * pan_px, axis=1)
        blurred = _blurred(scene)
        change = error(frame, scene)
        change *= np.sqrt(SHARE * np.mean((blurred - scene) ** 2) / np.mean(change**2))
        images = (scene, scene + change, blurred)
        reference, flickering, steady = (np.maximum(i, 0.0).astype(np.float32) for i in images)
        found.append((reference, flickering, steady))
    return found


def measure(mode: Mode, monitor: Monitor) -> dict[str, Pair]:
    """Scores of all examples, by name.

    Parameters
    ----------
    mode : Mode
        The metric.
    monitor : Monitor
        Shows the progress over the examples.
    """
    pairs = {}
    for example, (_, pan_px) in counted(list(EXAMPLES.items()), f"flicker, {mode.name}", monitor):
        viewing = screen(SIZE_PX, PIXELS_PER_DEGREE, fps=FPS)
        flow_px = np.zeros((SIZE_PX, SIZE_PX, 2), dtype=np.float32)
        flow_px[..., 0] = -pan_px
        frames = sequences(example)
        scores = []
        for kind in (1, 2):
            metric = SequenceAqm(mode.aqm(viewing))
            found = (metric.compare(frame[kind], frame[0], backward_flow_px=flow_px) for frame in frames)
            scores.append(sequence_score(comparison.score for comparison in found))
        pairs[example] = Pair(*scores)
    return pairs
