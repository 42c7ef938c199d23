"""What a run did and what it cost, from its ledger and nothing else: Tables 1 and 2 (§6)."""

from __future__ import annotations

import resource
from typing import Any

from enfilade.pipeline.survey import Survey
from enfilade.store import Run, tally


def summarize(run: Run, survey: Survey, video: str, *, has_workers: bool) -> dict[str, Any]:
    """Gather the figures of a finished run.

    Returns
    -------
    dict
        Those of :func:`~enfilade.store.tally`; ``peak_memory_bytes``: of this process or of the largest of
        its workers; ``video``.
    """
    children = [resource.RUSAGE_CHILDREN] if has_workers else []
    peak = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, *children))
    return {
        **tally(run.identity, run.lines(), survey.speed_deg_s),
        "peak_memory_bytes": peak * 1024,
        "video": video,
    }
