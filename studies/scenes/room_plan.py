"""ROOM's plan, metres: x runs east, y north, z up; the windows look west."""

from __future__ import annotations

LENGTH, WIDTH, HEIGHT = 7.2, 5.4, 2.9
DADO_HEIGHT = 0.95
WINDOWS, WINDOW_WIDTH, SILL, HEAD = (1.55, 3.85), 1.45, 0.5, 2.45  # centres along y
HEARTH_X, TABLE, LAMPS = 5.2, (2.1, 2.45), ((1.5, 2.45), (2.75, 2.45))
LAMP_RIM = 1.50
LANTERN = ((3.45, 1.75), (6.15, 3.65))  # the roof light, corners in plan
BOOKS = ("#7b2d2b", "#2f4d6a", "#3f5a3c", "#c59a4a", "#e2d6bd", "#59395a", "#b5643c")
