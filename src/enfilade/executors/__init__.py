"""Who does the units of work of a run: this process, worker processes on this machine, or a Ray cluster.

What a unit is and how it is done, the pipeline says; here is who does it, in what order, and what becomes of
workers that die.
"""

from enfilade.executors.executor import Event, Executor, Failure, FailureKind, Recipe
from enfilade.executors.graph import Graph
from enfilade.executors.opener import EXECUTORS, open_executor
from enfilade.executors.resources import cores
from enfilade.executors.supervisor import ATTEMPTS, supervise
from enfilade.executors.unit import Unit

__all__ = [
    "ATTEMPTS",
    "EXECUTORS",
    "Event",
    "Executor",
    "Failure",
    "FailureKind",
    "Graph",
    "Recipe",
    "Unit",
    "cores",
    "open_executor",
    "supervise",
]
