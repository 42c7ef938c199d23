"""Frames for measures: a picture, its copies with errors, and flow."""

from __future__ import annotations

import numpy as np

from enfilade.comparison.measures import display_pair
from enfilade.kernels.tone import srgb_decode
from enfilade.records import Flow
from enfilade.viewing import Viewing
from studies.bench.measures import WindowPair

HEIGHT, WIDTH = 48, 64
VIEWING = Viewing(WIDTH, HEIGHT, diagonal_m=0.025)  # 28 pixels per degree


def picture(shift: float = 0.0) -> np.ndarray:
    """Waves that move to the right, sRGB-encoded (H, W, 3), 0.3..0.7."""
    x = np.arange(WIDTH) - shift
    y = np.arange(HEIGHT)[:, None]
    waves = 0.5 + 0.1 * np.sin(x / 4.0) + 0.1 * np.sin(y / 5.0)
    return np.repeat(waves[..., None], 3, axis=2).astype(np.float32)


def noise(seed: int, size: float) -> np.ndarray:
    return (size * np.random.default_rng(seed).standard_normal((HEIGHT, WIDTH, 3))).astype(np.float32)


def pair(
    test: np.ndarray, reference: np.ndarray, *, shift: float = 0.0, is_first: bool = False
) -> WindowPair:
    """Encoded images as a measure sees them; the surfaces move by `shift` pixels a frame."""
    backward = np.zeros((HEIGHT, WIDTH, 2), np.float32)
    backward[..., 0] = -shift
    flow = Flow(np.zeros_like(backward) if is_first else backward, -backward, not is_first, True)
    linear, wanted = (srgb_decode(image).astype(np.float32) for image in (test, reference))
    shown = display_pair(linear, wanted, VIEWING)
    return WindowPair(
        **vars(shown),
        linear=linear,
        linear_reference=wanted,
        linear_halves=(wanted, wanted),
        halves=(shown.reference, shown.reference),
        flow=flow,
    )
