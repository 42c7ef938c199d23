"""Judges of a sequence against its reference: each takes frames in order, and one number says the end.

>>> import numpy as np
>>> from enfilade.compare.measures import Psnr, shown
>>> from enfilade.viewing import Viewing
>>> grey = np.full((48, 64, 3), 0.5, np.float32)
>>> pair = shown(grey * 1.1, grey, Viewing(64, 48))
>>> judge = Psnr()
>>> round(judge.pooled([judge.judge(pair)]), 1)
30.2
"""

from __future__ import annotations

from enfilade.compare.measures.aqm import AqmJudge
from enfilade.compare.measures.colorvideovdp import ColorVideoVdp
from enfilade.compare.measures.flip import Flip
from enfilade.compare.measures.judge import Judge, Scale
from enfilade.compare.measures.panel import JUDGES, SCALES, open_judge, why_missing
from enfilade.compare.measures.psnr import Psnr
from enfilade.compare.measures.shown import Shown, shown
from enfilade.compare.measures.temporal import Temporal, seen_before

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
