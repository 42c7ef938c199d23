"""GALLERY's plan, metres: x runs east along the hall, y north, z up; the sun shines from the south-west."""

from __future__ import annotations

LENGTH, WIDTH, HEIGHT = 13.0, 7.0, 4.8
WALL = 0.32  # thickness
WINDOWS_X, WINDOW_WIDTH, SILL, HEAD = (2.0, 5.0, 8.0, 11.0), 1.9, 0.65, 4.3  # of the south wall
EAST_WINDOW, EAST_WIDTH, EAST_SILL, EAST_HEAD = 3.6, 2.6, 0.6, 4.1  # centre along y, of the east wall
SUN = (0.35, 0.85, -0.30)  # direction of travel: 18 degrees above the horizon
