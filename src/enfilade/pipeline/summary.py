"""What a run did and what it cost, from its ledger and nothing else: Tables 1 and 2 (§6)."""

from __future__ import annotations

import resource
from typing import Any

from enfilade.pipeline.survey import Survey
from enfilade.pipeline.workshop import Workshop
from enfilade.store import tally


def summarize(workshop: Workshop, survey: Survey, video: str) -> dict[str, Any]:
    """Gather the figures of a finished run.

    Returns
    -------
    dict
        Those of :func:`~enfilade.store.tally`; ``peak_memory_bytes``: of this process; ``video``.
    """
    run = workshop.run
    return {
        **tally(run.identity, run.lines(), survey.speed_deg_s),
        "peak_memory_bytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
        "video": video,
    }
