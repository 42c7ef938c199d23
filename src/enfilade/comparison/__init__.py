"""Judging two sequences: opened side by side, followed along their motion, judged frame by frame (§3)."""

from __future__ import annotations

from enfilade.comparison.judge import JudgedFrame, Terms, compare
from enfilade.comparison.motion import FlowChoice
from enfilade.comparison.verdict import FrameDifference, SequenceDifference, meaning, psnr_db

__all__ = [
    "FlowChoice",
    "FrameDifference",
    "JudgedFrame",
    "SequenceDifference",
    "Terms",
    "compare",
    "meaning",
    "psnr_db",
]
