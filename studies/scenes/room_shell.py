"""ROOM's shell: floor, walls, roof light, windows, hearth, door and pictures."""

from __future__ import annotations

import numpy as np
import shapely

from studies.scenes import joinery, objects, pictures
from studies.scenes.joinery import EAST, NORTH, SOUTH, WEST
from studies.scenes.pieces import flat, hang_picture
from studies.scenes.presets import Preset
from studies.scenes.room_plan import (
    DADO_HEIGHT,
    HEAD,
    HEARTH_X,
    HEIGHT,
    LANTERN,
    LENGTH,
    SILL,
    WIDTH,
    WINDOW_WIDTH,
    WINDOWS,
)
from studies.scenes.shading import box_mapped
from studies.scenes.solids import extrude_parts, join, span, sphere
from studies.scenes.sweeps import moulding, tube
from studies.scenes.writer import SceneWriter

LANTERN_RIM = [(0.4 * out, 0.35 * z) for out, z in joinery.CORNICE]  # low: it must not shade the walls


def add_shell(writer: SceneWriter) -> None:
    """Add floor, ceiling, walls and their mouldings."""
    floor = flat(LENGTH, WIDTH, (LENGTH / 3.6, WIDTH / 3.6)).at(LENGTH / 2, WIDTH / 2)
    writer.mesh("floor", floor, "floor")
    opening = shapely.box(*LANTERN[0], *LANTERN[1])
    ceiling = extrude_parts(shapely.box(0, 0, LENGTH, WIDTH) - opening, 0.1)
    writer.mesh("ceiling", ceiling.at(0, 0, HEIGHT), "plaster")
    holes = [shapely.box(y - WINDOW_WIDTH / 2, SILL, y + WINDOW_WIDTH / 2, HEAD) for y in WINDOWS]
    sides = {
        "north": (LENGTH, NORTH, 0.0, WIDTH, []),
        "west": (WIDTH, WEST, 0.0, 0.0, holes),
        "south": (LENGTH, SOUTH, LENGTH, 0.0, []),
        "east": (WIDTH, EAST, LENGTH, WIDTH, []),
    }
    for name, (length, turn, x, y, openings) in sides.items():
        lower = joinery.wall(shapely.box(0, 0, length, DADO_HEIGHT), openings, 0.25)
        writer.mesh(f"wall-{name}-lower", lower.turned(turn).at(x, y), "joinery")
        upper = joinery.wall(shapely.box(0, DADO_HEIGHT, length, HEIGHT), openings, 0.25)
        upper = box_mapped(upper, 0.42)
        writer.mesh(f"wall-{name}-upper", upper.turned(turn).at(x, y), "wallpaper")
    ends = ((0.0, 0.0), (LENGTH, WIDTH))
    writer.mesh("cornice", joinery.ring(joinery.CORNICE, *ends, HEIGHT), "plaster")
    mouldings = [joinery.ring(joinery.SKIRTING, *ends, 0.0)]
    corners = [
        (0.0, WINDOWS[0] - 0.84),
        (0.0, 0.0),
        (LENGTH, 0.0),
        (LENGTH, WIDTH),
        (0.0, WIDTH),
        (0.0, WINDOWS[1] + 0.84),
    ]
    rail = moulding(joinery.DADO, corners).at(0, 0, DADO_HEIGHT)
    between = moulding(joinery.DADO, [(0.0, WINDOWS[1] - 0.84), (0.0, WINDOWS[0] + 0.84)])
    writer.mesh("mouldings", join([*mouldings, rail, between.at(0, 0, DADO_HEIGHT)]), "joinery")
    panels = [
        joinery.hung(joinery.panelling(LENGTH, 0.24, 0.82, 9), 0, WIDTH, 0, NORTH),
        joinery.hung(joinery.panelling(LENGTH, 0.24, 0.82, 9), LENGTH, 0, 0, SOUTH),
        joinery.hung(joinery.panelling(WIDTH, 0.24, 0.82, 7), LENGTH, WIDTH, 0, EAST),
    ]
    writer.mesh("panelling", join(panels), "joinery")


def add_lantern(writer: SceneWriter) -> None:
    """Open the ceiling to a roof light with glazing bars; most of the light comes from it."""
    (x0, y0), (x1, y1) = LANTERN
    walls = [
        span((x0 - 0.1, y0 - 0.1, HEIGHT), (x0, y1 + 0.1, HEIGHT + 0.3)),
        span((x1, y0 - 0.1, HEIGHT), (x1 + 0.1, y1 + 0.1, HEIGHT + 0.3)),
        span((x0 - 0.1, y0 - 0.1, HEIGHT), (x1 + 0.1, y0, HEIGHT + 0.3)),
        span((x0 - 0.1, y1, HEIGHT), (x1 + 0.1, y1 + 0.1, HEIGHT + 0.3)),
    ]
    bars = [
        span((x - 0.025, y0, HEIGHT - 0.02), (x + 0.025, y1, HEIGHT + 0.03))
        for x in np.linspace(x0, x1, 6)[1:-1]
    ]
    bars += [
        span((x0, y - 0.025, HEIGHT - 0.02), (x1, y + 0.025, HEIGHT + 0.03))
        for y in np.linspace(y0, y1, 4)[1:-1]
    ]
    line = [(x0, y0), (x0, y1), (x1, y1), (x1, y0)]
    rim = moulding(LANTERN_RIM, line, closed=True).at(0, 0, HEIGHT)
    writer.mesh("lantern", join([*walls, *bars, rim]), "plaster")
    sky = flat(x1 - x0, y1 - y0).turned(180, "x")
    writer.mesh("lantern-sky", sky.at((x0 + x1) / 2, (y0 + y1) / 2, HEIGHT + 0.05), "plaster")
    writer.light("#f4f8ff", 7.2, weight=5.0)


def add_windows(writer: SceneWriter, preset: Preset) -> None:
    """Add the casements, sills and curtains, and the garden behind them, which gives the light."""
    frames, sills, rods, folds = [], [], [], []
    for y in WINDOWS:
        window = joinery.casement(WINDOW_WIDTH, HEAD - SILL, 4, 4).turned(WEST)
        frames.append(window.at(-0.08, y, SILL))
        surround = joinery.hung(joinery.architrave(WINDOW_WIDTH, HEAD - SILL), 0, y, SILL, WEST)
        sills += [surround, span((-0.2, y - 0.83, SILL - 0.04), (0.09, y + 0.83, SILL), 0.01)]
        rods.append(
            tube([(0.11, y - 1.08, 2.62), (0.11, y, 2.62), (0.11, y + 1.08, 2.62)], 0.014, preset.segments)
        )
        for side in (-1, 1):
            cloth = joinery.curtain(0.36, 2.55, 5, preset.segments // 2).turned(WEST)
            folds.append(cloth.at(0.11, y + side * 0.88, 0.06))
    writer.mesh("casements", join(frames), "joinery")
    writer.mesh("window-surrounds", join(sills), "joinery")
    writer.mesh("curtain-rods", join(rods), "brass")
    writer.mesh("curtains", join(folds), "curtain", crease_deg=80)
    garden = flat(9.0, 4.0).turned(90, "x").turned(WEST).at(-1.9, WIDTH / 2, 1.15)
    writer.mesh("garden", garden, "soot")
    writer.light(writer.radiance("garden", pictures.garden(preset.texture // 4, 1.6)), weight=0.7)
    writer.sun((0.72, 0.2, -1.0), "#fff0d2", 5.0, weight=2.5)


def add_hearth(writer: SceneWriter, preset: Preset) -> None:
    """Add the fireplace with its tiled surround, mantel and picture."""
    x, y = HEARTH_X, WIDTH
    tiles = [
        span((x - 0.72, y - 0.16, 0), (x - 0.36, y, 1.06), 0.002),
        span((x + 0.36, y - 0.16, 0), (x + 0.72, y, 1.06), 0.002),
        span((x - 0.37, y - 0.16, 0.72), (x + 0.37, y, 1.06), 0.002),
    ]
    writer.mesh("hearth-tiles", box_mapped(join(tiles), 0.36), "tile")
    slab = span((x - 0.95, y - 0.62, 0), (x + 0.95, y - 0.1, 0.035), 0.01)
    writer.mesh("hearth-slab", slab, "soot")
    writer.mesh("firebox", span((x - 0.37, y - 0.05, 0.03), (x + 0.37, y, 0.73)), "soot")
    posts = [span((x + s * 0.83 - 0.11, y - 0.20, 0), (x + s * 0.83 + 0.11, y, 1.10), 0.012) for s in (-1, 1)]
    caps = [
        span((x + s * 0.83 - 0.13, y - 0.225, a), (x + s * 0.83 + 0.13, y, b), 0.012)
        for s in (-1, 1)
        for a, b in ((0.0, 0.16), (1.02, 1.08))
    ]
    shelf = [
        span((x - 0.96, y - 0.21, 1.06), (x + 0.96, y, 1.20), 0.01),
        span((x - 1.02, y - 0.27, 1.20), (x + 1.02, y, 1.235), 0.014),
        span((x - 1.05, y - 0.30, 1.235), (x + 1.05, y, 1.265), 0.01),
    ]
    writer.mesh("mantel", join([*posts, *caps, *shelf]), "joinery")
    logs = [
        tube(
            [
                (x - 0.24, y - 0.13 - 0.05 * k, 0.09 + 0.05 * (k == 1)),
                (x, y - 0.14, 0.10 + 0.06 * (k == 1)),
                (x + 0.24, y - 0.20 + 0.05 * k, 0.09 + 0.05 * (k == 1)),
            ],
            0.042,
            preset.segments,
        )
        for k in range(3)
    ]
    writer.mesh("logs", join(logs), "walnut-edge")
    hang_picture(writer, "mantel-picture", "painting-hills", (1.15, 0.80), (x, y, 1.98), NORTH)
    n = 2 * preset.segments
    for k, (kind, colour, dx) in enumerate(
        (("bottle", "glaze-blue", -0.82), ("jar", "glaze-ochre", 0.78), ("bottle", "glaze-cream", 0.56))
    ):
        vessel = objects.vase(kind, n, 0.9).at(x + dx, y - 0.15, 1.265)
        writer.mesh(f"mantel-vase-{k}", vessel, colour)


def dress_walls(writer: SceneWriter) -> None:
    """Add the door and the pictures of the south wall."""
    x = 1.45
    door = joinery.panelled_door(0.9, 2.05).at(0, 0, 0.03)
    writer.mesh("door", joinery.hung(door, x, 0, 0, SOUTH), "joinery")
    surround = joinery.hung(joinery.architrave(0.92, 2.06), x, 0, 0, SOUTH)
    writer.mesh("door-surround", surround, "joinery")
    writer.mesh("door-knob", sphere(0.028, 16).at(x + 0.36, 0.07, 1.0), "brass")
    for k, (along, size, art) in enumerate(
        (
            (3.3, (0.5, 0.66), "painting-stem"),
            (4.6, (0.95, 0.66), "painting-hills"),
            (5.9, (0.6, 0.6), "painting-discs"),
        )
    ):
        hang_picture(writer, f"south-picture-{k}", art, size, (along, 0.0, 1.72), SOUTH)
