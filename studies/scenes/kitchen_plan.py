"""KITCHEN's plan, metres: x runs east, y north, z up; worktops stand along the north and east walls."""

from __future__ import annotations

LENGTH, WIDTH, HEIGHT = 6.4, 4.8, 2.7
WALL = 0.25  # thickness
DEPTH, TOP, SLAB = 0.62, 0.91, 0.04  # of the worktops: depth, height and thickness
SHELF_LOW, SHELF_HIGH, SHELF_DEPTH = 1.42, 2.15, 0.34  # of the wall cupboards
WINDOW, WINDOW_WIDTH, WINDOW_SILL, WINDOW_HEAD = 2.55, 1.3, 1.12, 2.2  # centre along x, of the north wall
CUPBOARDS = ((0.02, 1.75), (3.35, 4.35))  # wall cupboards, from x to x
STOVE = 4.8  # centre along x
TABLE, TABLE_SIZE = (2.9, 1.95), (1.9, 0.92, 0.75)
PENDANTS, PENDANT_RIM = ((2.4, 1.95), (3.4, 1.95)), 1.62
SINK = (WINDOW, WIDTH - 0.33, 0.56, 0.40)  # centre, length and width of the basin
