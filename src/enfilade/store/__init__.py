"""The run folder: what a run is, what it has finished, and the files that say so.

::

    run.json         identity: scene fingerprint, path, settings, versions, method
    keyframes/NNNN.exr   cells/NNNN.npz   raw/NNNN.exr   frames/NNNN.exr   by frame number, 4 digits or more
    ledger.jsonl     one line for each finished unit of work
    clips/NNNN.mp4   parts of the video, by the number of their first frame
    summary.json     plots/     video.mp4
    run.lock         who is writing here
"""

from __future__ import annotations

from enfilade.store.run import KINDS, Run
from enfilade.store.tally import add_costs, tally

__all__ = ["KINDS", "Run", "add_costs", "tally"]
