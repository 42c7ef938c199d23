"""KITCHEN's shell: floor, walls, tiles, the dark window, and lamps."""

from __future__ import annotations

import shapely

from studies.scenes import colonnade, joinery, objects
from studies.scenes.joinery import EAST, NORTH, SOUTH, WEST
from studies.scenes.kitchen_plan import (
    CUPBOARDS,
    HEIGHT,
    LENGTH,
    PENDANT_RIM,
    PENDANTS,
    SHELF_LOW,
    STOVE,
    TOP,
    WALL,
    WIDTH,
    WINDOW,
    WINDOW_HEAD,
    WINDOW_SILL,
    WINDOW_WIDTH,
)
from studies.scenes.pieces import flat
from studies.scenes.presets import Preset
from studies.scenes.shading import box_mapped
from studies.scenes.solids import join, lathe, span
from studies.scenes.writer import SceneWriter


def add_shell(writer: SceneWriter) -> None:
    """Add floor, ceiling, walls, mouldings and the tiles above the worktops; the room is closed."""
    length, width = LENGTH + 2 * WALL, WIDTH + 2 * WALL
    floor = flat(length, width, (length / 2.4, width / 2.4)).at(LENGTH / 2, WIDTH / 2)
    writer.mesh("floor", floor, "floor")
    ceiling = span((-WALL, -WALL, HEIGHT), (LENGTH + WALL, WIDTH + WALL, HEIGHT + 0.1))
    writer.mesh("ceiling", ceiling, "plaster")
    hole = shapely.box(WINDOW - WINDOW_WIDTH / 2, WINDOW_SILL, WINDOW + WINDOW_WIDTH / 2, WINDOW_HEAD)
    sides = {
        "north": (LENGTH, NORTH, 0.0, WIDTH, [hole]),
        "west": (WIDTH, WEST, 0.0, 0.0, []),
        "south": (LENGTH, SOUTH, LENGTH, 0.0, []),
        "east": (WIDTH, EAST, LENGTH, WIDTH, []),
    }
    for name, (along, turn, x, y, openings) in sides.items():
        plate = joinery.wall(shapely.box(-WALL, -0.05, along + WALL, HEIGHT + 0.05), openings, WALL)
        writer.mesh(f"wall-{name}", plate.turned(turn).at(x, y), "paint")
    ends = ((0.0, 0.0), (LENGTH, WIDTH))
    trim = [joinery.ring(joinery.SKIRTING, *ends, 0.0), joinery.ring(joinery.CORNICE, *ends, HEIGHT)]
    writer.mesh("mouldings", join(trim), "joinery")
    plate = joinery.wall(shapely.box(0.0, TOP, LENGTH, SHELF_LOW + 0.25), [hole], 0.008)
    north = box_mapped(plate, (0.6, 0.6)).at(0.0, WIDTH - 0.008)
    plate = joinery.wall(shapely.box(0.0, TOP, 2.2, SHELF_LOW + 0.25), [], 0.008)
    east = box_mapped(plate, (0.6, 0.6)).turned(EAST).at(LENGTH - 0.008, WIDTH)
    writer.mesh("tiles", join([north, east]), "tiles")


def add_window(writer: SceneWriter) -> None:
    """Add the window, a pane that mirrors the room before the night."""
    height = WINDOW_HEAD - WINDOW_SILL
    bars = joinery.casement(WINDOW_WIDTH, height, 2, 2, 0.025).at(WINDOW, WIDTH + 0.1, WINDOW_SILL)
    surround = joinery.hung(
        joinery.architrave(WINDOW_WIDTH, height), WINDOW, WIDTH - 0.008, WINDOW_SILL, NORTH
    )
    sill = span(
        (WINDOW - WINDOW_WIDTH / 2 - 0.08, WIDTH - 0.1, WINDOW_SILL - 0.03),
        (WINDOW + WINDOW_WIDTH / 2 + 0.08, WIDTH + WALL, WINDOW_SILL),
        0.006,
    )
    writer.mesh("window-frame", join([bars, surround, sill]), "joinery")
    x0, x1, y = WINDOW - WINDOW_WIDTH / 2, WINDOW + WINDOW_WIDTH / 2, WIDTH + 0.13
    corners = ((x0, y, WINDOW_SILL), (x1, y, WINDOW_SILL), (x1, y, WINDOW_HEAD), (x0, y, WINDOW_HEAD))
    writer.mesh("window-pane", colonnade.pane(corners), "glass-pane")
    night = flat(WINDOW_WIDTH + 0.6, height + 0.6).turned(90, "x")
    writer.mesh("night", night.at(WINDOW, WIDTH + WALL + 0.02, WINDOW_SILL + height / 2), "night")


def add_lamps(writer: SceneWriter, preset: Preset) -> None:
    """Add pendants over the table, strips under the cupboards, discs in the ceiling and a spot light."""
    parts = objects.pendant(HEIGHT - PENDANT_RIM, preset.segments)
    names = {"pendant-shades": "enamel-red", "pendant-fittings": "brass", "bulbs": "glow"}
    for (name, material), part in zip(names.items(), parts, strict=True):
        writer.mesh(name, join(part.bare().at(x, y, PENDANT_RIM) for x, y in PENDANTS), material)
    writer.light("#ffd6a0", 75.0, weight=2.0)
    strips = [
        flat(x1 - x0 - 0.2, 0.022).turned(180, "x").at((x0 + x1) / 2, WIDTH - 0.20, SHELF_LOW - 0.012)
        for x0, x1 in CUPBOARDS
    ]
    writer.mesh("strips", join(strips), "glow")
    writer.light("#fff0d8", 24.0)
    housings = [
        span((x0 + 0.08, WIDTH - 0.225, SHELF_LOW - 0.011), (x1 - 0.08, WIDTH - 0.175, SHELF_LOW), 0.002)
        for x0, x1 in CUPBOARDS
    ]
    writer.mesh("strip-housings", join(housings), "steel-brushed")
    disc = lathe([(0.0, 0.0), (0.14, 0.0)], 3 * preset.segments).bare()
    rim = lathe([(0.14, 0.0), (0.142, -0.012), (0.165, -0.01), (0.17, 0.005)], 3 * preset.segments).bare()
    spots = ((1.2, 3.5), (3.2, 3.7), (5.1, 3.3), (5.3, 1.2), (3.0, 0.7), (0.9, 1.1))
    writer.mesh("ceiling-discs", join(disc.at(x, y, HEIGHT - 0.006) for x, y in spots), "glow")
    writer.light("#ffe2b8", 46.0, weight=4.0)
    writer.mesh("ceiling-disc-rims", join(rim.at(x, y, HEIGHT - 0.006) for x, y in spots), "chrome")
    writer.spot((STOVE, WIDTH - 0.30, 1.66), (STOVE, WIDTH - 0.34, TOP), "#fff2dc", 2.6, cutoff_deg=42.0)
