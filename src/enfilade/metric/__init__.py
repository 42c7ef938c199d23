"""The animation quality metric: visible differences between two rendered images or sequences (§3).

Usable alone, with NumPy arrays of luminance: `Aqm` for images, `SequenceAqm` for sequences.
"""

from enfilade.metric.aqm import Aqm
from enfilade.metric.comparison import Comparison, Part
from enfilade.metric.halves import HalvesAqm, LuminanceHalves
from enfilade.metric.modern import ModernMetric
from enfilade.metric.paper import PaperMetric
from enfilade.metric.sequence import SequenceAqm, sequence_score
from enfilade.metric.transducer import Transducer
from enfilade.settings import Pursuit

__all__ = [
    "Aqm",
    "Comparison",
    "HalvesAqm",
    "LuminanceHalves",
    "ModernMetric",
    "PaperMetric",
    "Part",
    "Pursuit",
    "SequenceAqm",
    "Transducer",
    "sequence_score",
]
