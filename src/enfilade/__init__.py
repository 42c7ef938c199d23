"""enfilade: camera walkthroughs at a small part of the cost of path tracing every frame."""

__version__ = "0.1.0"
