"""Comparing two sequences: read side by side, followed along their motion, measured frame by frame (§3)."""

from __future__ import annotations

from enfilade.comparison.compare import ComparedFrame, Show, Terms, compare
from enfilade.comparison.motion import FlowChoice
from enfilade.comparison.result import FrameDifference, SequenceDifference, psnr_db

__all__ = [
    "ComparedFrame",
    "FlowChoice",
    "FrameDifference",
    "SequenceDifference",
    "Show",
    "Terms",
    "compare",
    "psnr_db",
]
