"""Where a viewer sees a difference between two rendered images (§3); usable alone.

>>> import numpy as np
>>> from enfilade.metric import Aqm
>>> from enfilade.viewing import Viewing
>>> metric = Aqm(Viewing(64, 48))
>>> grey = np.full((48, 64), 20.0, dtype=np.float32)
>>> metric.compare(grey, grey).percent_visible
0.0
"""

from enfilade.metric.aqm import Aqm
from enfilade.metric.comparison import Comparison, Part
from enfilade.metric.eye import Pursuit
from enfilade.metric.options import Fitted, MetricOptions
from enfilade.metric.sequence import SequenceAqm, sequence_score

__all__ = ["Aqm", "Comparison", "Fitted", "MetricOptions", "Part", "Pursuit", "SequenceAqm", "sequence_score"]
