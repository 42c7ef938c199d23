"""The analytic scenes of the tests, for benchmarks and for the commands that they start."""

import os
import sys
from pathlib import Path

TESTS = str(Path(__file__).parents[1] / "tests")
sys.path.append(TESTS)
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [TESTS, os.environ.get("PYTHONPATH")]))

from support.analytic_scene import AnalyticScene, Material, Plane, Sphere, Waves, write_scene  # noqa: E402

__all__ = ["BALL", "RENDERER", "WALL", "AnalyticScene", "Material", "Sphere", "write_scene"]

RENDERER = ("--renderer", "support.analytic:load")
WALL = Plane((0, 0, 0), (0, 0, 1), Material(Waves((0.2, 0.3, 0.5), (0.9, 0.7, 0.4), period=1.3)), "wall")
BALL = Sphere((0.5, 0.0, 1.0), 0.5, Material((0.7, 0.2, 0.15)), "ball")
