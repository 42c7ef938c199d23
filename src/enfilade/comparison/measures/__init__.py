"""Judges of a sequence against its reference: each takes frames in order, and one number says the end.

>>> import numpy as np
>>> from enfilade.comparison.measures import Psnr, shown
>>> from enfilade.viewing import Viewing
>>> grey = np.full((48, 64, 3), 0.5, np.float32)
>>> pair = shown(grey * 1.1, grey, Viewing(64, 48))
>>> judge = Psnr()
>>> round(judge.pooled([judge.judge(pair)]), 1)
30.2
"""

from __future__ import annotations

from enfilade.comparison.measures.aqm import AqmJudge
from enfilade.comparison.measures.colorvideovdp import ColorVideoVdp
from enfilade.comparison.measures.flip import Flip
from enfilade.comparison.measures.judge import Judge, Scale
from enfilade.comparison.measures.panel import JUDGES, SCALES, open_judge, why_missing
from enfilade.comparison.measures.psnr import Psnr
from enfilade.comparison.measures.shown import Shown, shown
from enfilade.comparison.measures.temporal import Temporal, seen_before

__all__ = [
    "JUDGES",
    "SCALES",
    "AqmJudge",
    "ColorVideoVdp",
    "Flip",
    "Judge",
    "Psnr",
    "Scale",
    "Shown",
    "Temporal",
    "open_judge",
    "seen_before",
    "shown",
    "why_missing",
]
