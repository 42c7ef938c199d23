"""Comparing two sequences: read side by side, followed along their motion, measured frame by frame (§3)."""

from __future__ import annotations

from enfilade.comparison.compare import ComparedFrame, CompareOptions, Show, compare
from enfilade.comparison.measures.psnr import psnr_db
from enfilade.comparison.result import FrameDifference, SequenceDifference, short_name

__all__ = [
    "CompareOptions",
    "ComparedFrame",
    "FrameDifference",
    "SequenceDifference",
    "Show",
    "compare",
    "psnr_db",
    "short_name",
]
