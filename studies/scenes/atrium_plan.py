"""ATRIUM's plan, metres: x runs east along the hall, y north, z up."""

from __future__ import annotations

LENGTH, WIDTH, HEIGHT = 22.0, 14.0, 8.5
GALLERY, SLAB = 4.08, 0.40  # height of the upper floor, and its thickness
SOUTH_EDGE, NORTH_EDGE, EAST_EDGE = 2.8, 11.2, 18.4
COLUMNS_X = (3.2, 7.0, 10.8, 14.6, 18.4)
BAYS_X = (1.3, 5.1, 8.9, 12.7, 16.5, 20.2)
STAIR_LOW, STAIR_HIGH, STEPS, RUN = 5.3, 8.7, 24, 0.28
STAIR_START = EAST_EDGE - STEPS * RUN
RISE = GALLERY / STEPS
