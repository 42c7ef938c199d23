"""The paper's experiments (§5, §6) on the scenes ROOM and ATRIUM, one module for each question."""

SCENES = ("room", "atrium")
