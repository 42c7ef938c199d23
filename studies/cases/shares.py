"""Table 1: share of traced pixels, by reason (§6)."""

from __future__ import annotations

from typing import Any

from studies.cases.case import Case

__all__ = ["PAPER", "measure"]

PAPER = {  # Table 1, percent
    "atrium": {"slow": 2.4, "specular": 40.8, "occlusion": 0.3, "keyframes": 6.0, "total": 49.5},
    "room": {"slow": 28.1, "specular": 0.0, "occlusion": 1.9, "keyframes": 5.1, "total": 35.1},
}


def measure(case: Case) -> dict[str, Any]:
    """Shares of traced pixels from the run's ledger, and of those that might have been.

    Returns
    -------
    dict
        ``table1``: percent by reason. ``specular_seen``: mean share of pixels on glossy, mirroring or
        transparent surfaces, traced or not; ``slow_seen``: below v_t, keyframes and repeated frames included.
        ``frames``, ``keyframes``: numbers of them.
    """
    summary, frames = case.rendered("paper"), case.analysis.frames
    return {
        "table1": summary["table1"],
        "specular_seen": sum(of.specular_percent for of in frames) / len(frames),
        "slow_seen": sum(of.slow_percent for of in frames) / len(frames),
        "frames": len(frames),
        "keyframes": sum(row["keyframe"] > 0.0 for row in summary["per_frame"]),
    }
