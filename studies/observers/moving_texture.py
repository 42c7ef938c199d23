"""Moving texture: quality loss by coarse shading of scrolling textures (Jindal et al. 2021).

A texture pans over the screen. One version is shaded in every pixel, the other once for two or four
neighbouring columns. 13 observers compared them on three displays at three speeds each. This tests the
prediction that motion hides detail.

The stimuli are reproduced pixel by pixel. A texel is as wide as a pixel, and the texture moves by fractions
of a pixel. A sample for n columns reads the mipmap level of n by n texels at the centre of the columns; the
columns are fixed on the screen while the texture moves. White is twice the display's mean luminance. As in
the authors' model, 2 deg/s are subtracted from each speed, for the constant rotation of the experiment.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.stats

from enfilade.metric import SequenceAqm, sequence_score
from enfilade.monitor import Monitor
from enfilade.records import F32, F64
from enfilade.viewing import Viewing
from studies.observers.mode import Mode
from studies.observers.screen import screen
from studies.observers.tables import read_columns, read_textures
from studies.progress import counted

ROWS = slice(192, 320)  # a quarter of the texture: rows are alike
FRAMES = 4  # the first has no previous frame
ROTATION_DEG_S = 2.0  # the authors' correction of all speeds


@dataclass(frozen=True)
class Display:
    """A display of the experiment.

    Attributes
    ----------
    pixels_per_degree, fps : float
        Pixels and images per second.
    mean_cd_m2 : float
        Luminance of a texture of mean 0.5.
    persistence : float
        Share of a frame's time for which the display is lit.
    """

    pixels_per_degree: float
    fps: float
    mean_cd_m2: float
    persistence: float = 1.0

    def viewing(self, width_px: int, height_px: int) -> Viewing:
        """Viewing conditions of an image on this display."""
        square = screen(width_px, self.pixels_per_degree, fps=self.fps, peak_cd_m2=2.0 * self.mean_cd_m2)
        return dataclasses.replace(square.cropped(width_px, height_px), persistence=self.persistence)


DISPLAYS = {
    "pc": Display(50.0, 144.0, 150.0),
    "phone": Display(90.0, 60.0, 75.0),
    "headset": Display(26.0, 144.0, 2.5, persistence=0.04),  # as in the published data
}
TEXTURES = frozenset({"checkerboard", "gradient", "grass", "noise"})
SCREENS = frozenset(DISPLAYS)


@dataclass(frozen=True)
class Condition:
    """A coarsely shaded texture on a display at a speed."""

    texture: str
    columns_per_sample: int
    display: str
    speed_deg_s: float


@dataclass(frozen=True, eq=False)
class Losses:
    """Quality losses by the observers and by the metric, for each condition.

    Attributes
    ----------
    conditions : tuple of Condition
        All 72.
    observers_jnd : (N,) float64
        Quality loss against shading in every pixel; below 0 where the observers preferred coarse shading.
    low_jnd, high_jnd : (N,) float64
        Distance down and up to the ends of the confidence interval.
    metric_jnd : (N,) float64
        Score of the sequence.
    """

    conditions: tuple[Condition, ...]
    observers_jnd: F64
    low_jnd: F64
    high_jnd: F64
    metric_jnd: F64

    def spearman(self, *, textures: frozenset[str] = TEXTURES, displays: frozenset[str] = SCREENS) -> float:
        """Rank correlation between observers and metric.

        Parameters
        ----------
        textures, displays : frozenset of str
            Conditions with one of each are counted.
        """
        chosen = np.array([c.texture in textures and c.display in displays for c in self.conditions])
        found = scipy.stats.spearmanr(self.observers_jnd[chosen], self.metric_jnd[chosen])
        return float(found.statistic)


def shade(texture: F32, shift_px: float, columns_per_sample: int) -> F32:
    """Shade a texture that is shifted to the right, as graphics hardware does.

    A sample for n columns interpolates in the mipmap level of n by n texels at the centre of the columns
    (without anisotropic filtering, which blurs along both axes). The columns are fixed on the screen.

    Parameters
    ----------
    texture : (H, W) float32
        One texel a pixel, periodic; sides are multiples of `columns_per_sample`.
    shift_px : float
        0 or more; fractions are allowed.
    columns_per_sample : int
        1, 2 or 4.

    Returns
    -------
    (H, W) float32
        The screen.
    """
    height, width = texture.shape
    size = columns_per_sample
    level = texture.reshape(height // size, size, width // size, size).mean(axis=(1, 3))
    columns = np.arange(width // size) * size + 0.5 * size - shift_px
    samples = _interpolated(level, columns / size, axis=1)
    samples = _interpolated(samples, (np.arange(height) + 0.5) / size, axis=0)
    return np.repeat(samples, size, axis=1)


def _interpolated(texels: F32, positions: F64, axis: int) -> F32:
    """Periodic texels, the centre of the first at 0.5, linearly interpolated along an axis."""
    first = np.floor(positions - 0.5)
    weight = (positions - 0.5 - first).astype(np.float32)
    weight = weight[None, :] if axis == 1 else weight[:, None]
    near = texels.take(first.astype(np.int64), axis=axis, mode="wrap")
    far = texels.take(first.astype(np.int64) + 1, axis=axis, mode="wrap")
    mixed: F32 = near + weight * (far - near)
    return mixed


def conditions() -> tuple[Condition, ...]:
    """All conditions, in the order of the table."""
    rows, columns = read_columns("moving_texture.csv", "columns_per_sample", "speed_deg_s")
    numbers = zip(columns["columns_per_sample"], columns["speed_deg_s"], strict=True)
    return tuple(
        Condition(row["texture"], int(count), row["display"], float(speed))
        for row, (count, speed) in zip(rows, numbers, strict=True)
    )


def frames(condition: Condition, texture: F32) -> Iterator[tuple[F32, F32]]:
    """Coarsely and fully shaded version of each frame, cd/m2.

    Parameters
    ----------
    condition : Condition
        Motion and shading of the texture.
    texture : (512, 512) float32
        Linear, 1 is white.
    """
    display = DISPLAYS[condition.display]
    white = np.float32(2.0 * display.mean_cd_m2)
    for frame in range(FRAMES):
        shift_px = frame * step_px(condition)
        coarse, full = (shade(texture, shift_px, n)[ROWS] for n in (condition.columns_per_sample, 1))
        yield white * coarse, white * full


def step_px(condition: Condition) -> float:
    """Motion of the texture from frame to frame, pixels."""
    display = DISPLAYS[condition.display]
    speed_deg_s = abs(condition.speed_deg_s - ROTATION_DEG_S)
    return speed_deg_s * display.pixels_per_degree / display.fps


def score(condition: Condition, texture: F32, mode: Mode) -> float:
    """Score of one condition's sequence, JND.

    Parameters
    ----------
    condition : Condition
        The condition.
    texture : (512, 512) float32
        Linear, 1 is white.
    mode : Mode
        The metric.
    """
    height, width = texture[ROWS].shape
    metric = SequenceAqm(mode.aqm(DISPLAYS[condition.display].viewing(width, height)))
    flow_px = np.zeros((height, width, 2), dtype=np.float32)
    flow_px[..., 0] = -step_px(condition)
    found = (
        metric.compare(coarse, full, backward_flow_px=flow_px) for coarse, full in frames(condition, texture)
    )
    return sequence_score(comparison.score for comparison in found)


def measure(mode: Mode, monitor: Monitor) -> Losses:
    """Scores of the metric for all conditions, beside the losses by the observers.

    Parameters
    ----------
    mode : Mode
        The metric.
    monitor : Monitor
        Shows the progress over the conditions.
    """
    textures = read_textures()
    _, observers = read_columns("moving_texture.csv", "jnd", "jnd_low", "jnd_high")
    chosen = conditions()
    scores = np.zeros(len(chosen))
    for index, condition in enumerate(counted(chosen, f"moving texture, {mode.name}", monitor)):
        scores[index] = score(condition, textures[condition.texture], mode)
    return Losses(chosen, -observers["jnd"], observers["jnd_high"], observers["jnd_low"], scores)
