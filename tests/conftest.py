"""The device is chosen before any test module imports a kernel: Dr.Jit binds its array types at import."""

import gc
import os
from pathlib import Path

import drjit as dr
import hypothesis
import pytest

from enfilade.device import activate

# Worker processes import the analytic renderer, too.
TESTS = str(Path(__file__).parent)
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [TESTS, os.environ.get("PYTHONPATH")]))

activate("auto")
hypothesis.settings.register_profile("enfilade", deadline=None)  # a busy machine is no failure
hypothesis.settings.load_profile("enfilade")


THREADS = dr.thread_count()


def pytest_collection_finish():
    """Spare the garbage collector, which runs often here, all modules and collected tests."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def own_thread_count():
    """Undo what a test of ``--threads`` has set for the whole process."""
    yield
    if dr.thread_count() != THREADS:
        dr.set_thread_count(THREADS)
