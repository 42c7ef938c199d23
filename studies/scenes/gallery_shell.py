"""GALLERY's shell: parquet, walls, ceiling, windows with thin bars, blinds, sun and sky."""

from __future__ import annotations

import numpy as np
import shapely

from studies.scenes import joinery, pictures
from studies.scenes.gallery_plan import (
    EAST_HEAD,
    EAST_SILL,
    EAST_WIDTH,
    EAST_WINDOW,
    HEAD,
    HEIGHT,
    LENGTH,
    SILL,
    SUN,
    WALL,
    WIDTH,
    WINDOW_WIDTH,
    WINDOWS_X,
)
from studies.scenes.joinery import EAST, NORTH, SOUTH, WEST
from studies.scenes.pieces import flat
from studies.scenes.presets import Preset
from studies.scenes.solids import Mesh, block, join, span
from studies.scenes.sweeps import tube
from studies.scenes.writer import SceneWriter

# Blinds of the south windows: slat depth, pitch (metres), tilt (degrees, inner edge up), height of the foot.
BLINDS = (
    (0.050, 0.060, 14.0, SILL + 0.02),
    (0.050, 0.060, 4.0, 1.9),
    (0.080, 0.105, 16.0, SILL + 0.03),
    (0.080, 0.105, 20.0, SILL + 0.03),
)
PARQUET_TILE = 1.6  # metres that one copy of the texture covers


def add_shell(writer: SceneWriter) -> None:
    """Add floor, ceiling, walls and mouldings; the hall is closed but for its windows."""
    length, width = LENGTH + 2 * WALL, WIDTH + 2 * WALL
    floor = flat(length, width, (length / PARQUET_TILE, width / PARQUET_TILE))
    writer.mesh("floor", floor.at(LENGTH / 2, WIDTH / 2), "parquet")
    ceiling = span((-WALL, -WALL, HEIGHT), (LENGTH + WALL, WIDTH + WALL, HEIGHT + 0.1))
    beams = [
        span((x - 0.13, 0.0, HEIGHT - 0.28), (x + 0.13, WIDTH, HEIGHT + 0.01), 0.01) for x in (3.5, 6.5, 9.5)
    ]
    writer.mesh("ceiling", join([ceiling, *beams]), "plaster")
    south = [LENGTH - x for x in WINDOWS_X]  # along the wall, which runs from its east end
    sides = {
        "north": (LENGTH, NORTH, 0.0, WIDTH, []),
        "west": (WIDTH, WEST, 0.0, 0.0, []),
        "south": (LENGTH, SOUTH, LENGTH, 0.0, [_opening(x, WINDOW_WIDTH, SILL, HEAD) for x in south]),
        "east": (
            WIDTH,
            EAST,
            LENGTH,
            WIDTH,
            [_opening(WIDTH - EAST_WINDOW, EAST_WIDTH, EAST_SILL, EAST_HEAD)],
        ),
    }
    for name, (along, turn, x, y, openings) in sides.items():
        plate = joinery.wall(shapely.box(-WALL, -0.05, along + WALL, HEIGHT + 0.05), openings, WALL)
        writer.mesh(
            f"wall-{name}", plate.turned(turn).at(x, y), "wall-north" if name == "north" else "plaster"
        )
    ends = ((0.0, 0.0), (LENGTH, WIDTH))
    trim = [joinery.ring(joinery.SKIRTING, *ends, 0.0), joinery.ring(joinery.CORNICE, *ends, HEIGHT)]
    writer.mesh("mouldings", join(trim), "joinery")


def add_windows(writer: SceneWriter) -> None:
    """Glaze nothing: frames with thin bars stand before the sky."""
    height = HEAD - SILL
    bars = [
        joinery.casement(WINDOW_WIDTH, height, 3, 5, 0.022).turned(SOUTH).at(x, 0.08 - WALL, SILL)
        for x in WINDOWS_X
    ]
    tall = joinery.casement(EAST_WIDTH, EAST_HEAD - EAST_SILL, 8, 9, 0.016).turned(EAST)
    bars.append(tall.at(LENGTH + 0.14, EAST_WINDOW, EAST_SILL))
    writer.mesh("window-bars", join(bars), "steel-dark", crease_deg=20)
    sills = [
        span(
            (x - WINDOW_WIDTH / 2 - 0.08, -WALL + 0.1, SILL - 0.04),
            (x + WINDOW_WIDTH / 2 + 0.08, 0.09, SILL),
            0.01,
        )
        for x in WINDOWS_X
    ]
    y0, y1 = EAST_WINDOW - EAST_WIDTH / 2 - 0.08, EAST_WINDOW + EAST_WIDTH / 2 + 0.08
    sills.append(span((LENGTH - 0.09, y0, EAST_SILL - 0.04), (LENGTH + WALL - 0.1, y1, EAST_SILL), 0.01))
    surrounds = [
        joinery.hung(joinery.architrave(WINDOW_WIDTH, height), x, 0.0, SILL, SOUTH) for x in WINDOWS_X
    ]
    surrounds.append(
        joinery.hung(
            joinery.architrave(EAST_WIDTH, EAST_HEAD - EAST_SILL), LENGTH, EAST_WINDOW, EAST_SILL, EAST
        )
    )
    writer.mesh("window-surrounds", join([*sills, *surrounds]), "joinery")


def add_blinds(writer: SceneWriter, preset: Preset) -> None:
    """Hang slatted blinds in the reveals of the south windows: two of narrow slats, two of wide ones."""
    hung = [
        _blind(WINDOW_WIDTH - 0.03, *blind, preset.segments // 2).at(x, -0.09)
        for x, blind in zip(WINDOWS_X, BLINDS, strict=True)
    ]
    writer.mesh("blinds-narrow", join(hung[:2]), "slat")
    writer.mesh("blinds-wide", join(hung[2:]), "slat-wood")


def add_daylight(writer: SceneWriter, preset: Preset) -> None:
    """Add the low sun and the sky.

    The sun is parallel light: a disc of its size would be found by chance after mirrors and glass, and single
    paths of such brightness would dominate every reference.
    """
    image = pictures.horizon(preset.texture // 4, 4.2, SUN)
    # PFM stores the lowest row first, and an environment's first row is the zenith.
    writer.environment(writer.radiance("horizon", image[::-1]), weight=1.5)
    writer.sun(SUN, "#ffe3b8", 11.0)


def _opening(along: float, width: float, low: float, high: float) -> shapely.Polygon:
    """Return the opening of a window, centred at a distance along its wall."""
    return shapely.box(along - width / 2, low, along + width / 2, high)


def _blind(width: float, depth: float, pitch: float, tilt_deg: float, foot: float, sides: int) -> Mesh:
    """Return a blind with its head at HEAD: slats, rails and cords, centred on y = 0."""
    slat = block((width, depth, 0.003), 0.0008).turned(tilt_deg, "x")
    heights = np.arange(HEAD - 0.09, foot + pitch / 2, -pitch)
    slats = [slat.at(0.0, 0.0, float(z)) for z in heights]
    low = float(heights[-1]) - pitch
    rails = [
        span((-width / 2, -0.03, HEAD - 0.06), (width / 2, 0.03, HEAD), 0.004),
        span((-width / 2, -0.02, low), (width / 2, 0.02, low + 0.02), 0.004),
    ]
    cords = [
        tube([(x, y, low), (x, y, (low + HEAD) / 2), (x, y, HEAD)], 0.0015, sides)
        for x in (-0.36 * width, 0.36 * width)
        for y in (-depth / 2, depth / 2)
    ]
    return join(part.bare() for part in (*slats, *rails, *cords))
