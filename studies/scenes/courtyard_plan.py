"""COURTYARD's plan, metres: x runs east, y north, z up; arcades of one depth surround the court."""

from __future__ import annotations

LENGTH, WIDTH = 13.0, 11.2  # within the outer walls
DEPTH = 2.6  # of the arcades
COURT = ((DEPTH, DEPTH), (LENGTH - DEPTH, WIDTH - DEPTH))
WALL = 0.3  # thickness
CEILING, PARAPET = 3.4, 4.0
SPRINGING, COLUMN = 2.25, 0.14  # height of the columns, and their radius
BAYS = (4, 3)  # of the arcades, along x and along y
DADO = 1.05  # height of the tiles
DOOR_WIDTH, DOOR_HEIGHT = 1.5, 2.35
DOORS_EAST, DOORS_NORTH = (3.6, 7.6), (3.6, 9.5)  # centres, along y and along x
SUN = (0.60, 0.46, -0.95)  # direction of travel: 51 degrees above the horizon
BASIN = (6.4, 5.4)
TABLE = (8.0, 9.85)
