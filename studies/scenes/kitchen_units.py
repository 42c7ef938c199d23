"""KITCHEN's fittings: worktops, cupboards, sink and tap, stove and hood, refrigerator, shelves, door."""

from __future__ import annotations

from studies.scenes import crockery, joinery
from studies.scenes.joinery import EAST, WEST
from studies.scenes.kitchen_plan import (
    CUPBOARDS,
    DEPTH,
    HEIGHT,
    LENGTH,
    SHELF_DEPTH,
    SHELF_HIGH,
    SHELF_LOW,
    SINK,
    SLAB,
    STOVE,
    TOP,
    WIDTH,
)
from studies.scenes.presets import Preset
from studies.scenes.shading import box_mapped
from studies.scenes.solids import Mesh, block, extrude, join, lathe, span
from studies.scenes.sweeps import tube
from studies.scenes.writer import SceneWriter

PLINTH = 0.10
STOVE_WIDTH = 0.6
EAST_RUN = 1.5  # length of the east worktop beyond the corner
SHELVES = (1.45, 1.82)  # heights of the open shelves on the east wall


def add_worktops(writer: SceneWriter) -> None:
    """Add the base cupboards and the wooden worktops along the north and east walls."""
    low, front = TOP - SLAB, WIDTH - DEPTH
    x0, x1 = STOVE - STOVE_WIDTH / 2, STOVE + STOVE_WIDTH / 2
    east, south = LENGTH - DEPTH, WIDTH - DEPTH - EAST_RUN
    bodies = [
        span((0.0, front + 0.03, PLINTH), (x0, WIDTH, low - 0.2), 0.002),
        span((x1, front + 0.03, PLINTH), (LENGTH, WIDTH, low), 0.002),
        span((east + 0.03, south, PLINTH), (LENGTH, front + 0.1, low), 0.002),
        span((0.0, front + 0.03, low - 0.21), (SINK[0] - 0.32, WIDTH, low), 0.002),
        span((SINK[0] + 0.32, front + 0.03, low - 0.21), (x0, WIDTH, low), 0.002),
        span((0.0, front + 0.08, 0.0), (x0, WIDTH, PLINTH), 0.002),
        span((x1, front + 0.08, 0.0), (LENGTH, WIDTH, PLINTH), 0.002),
        span((east + 0.08, south + 0.03, 0.0), (LENGTH, front + 0.1, PLINTH), 0.002),
    ]
    writer.mesh("base-bodies", join(bodies), "lacquer-white")
    height = low - PLINTH - 0.01
    north = crockery.fronts([x0 / 8] * 8, height)
    corner = crockery.fronts([east - x1], height)
    side = crockery.fronts([EAST_RUN / 3] * 3, height)
    doors = [
        north[0].at(0.0, front + 0.03, PLINTH),
        corner[0].at(x1, front + 0.03, PLINTH),
        side[0].turned(EAST).at(east + 0.03, front, PLINTH),
    ]
    handles = [
        north[1].at(0.0, front + 0.03, PLINTH),
        corner[1].at(x1, front + 0.03, PLINTH),
        side[1].turned(EAST).at(east + 0.03, front, PLINTH),
    ]
    writer.mesh("base-doors", join(doors), "lacquer-green")
    writer.mesh("base-handles", join(handles), "brass")
    outline = [(0.0, front), (x0, front), (x0, WIDTH), (0.0, WIDTH)]
    x, y, length, width = SINK
    hole = [(x + a * length / 2, y + b * width / 2) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    corner_top = [(x1, front), (east, front), (east, south), (LENGTH, south), (LENGTH, WIDTH), (x1, WIDTH)]
    tops = join([extrude(outline, SLAB, [hole]), extrude(corner_top, SLAB)])
    writer.mesh("worktops", box_mapped(tops, 0.9, grain="x").at(0, 0, low), "worktop")


def add_sink(writer: SceneWriter, preset: Preset) -> None:
    """Set the sink of brushed steel into the worktop, with a tap of chrome."""
    x, y, length, width = SINK
    writer.mesh("sink", crockery.basin(length, width, 0.17).at(x, y, TOP), "steel-brushed")
    writer.mesh("tap", crockery.tap(preset.segments).at(x, WIDTH - 0.075, TOP), "chrome", crease_deg=50)


def add_wall_cupboards(writer: SceneWriter) -> None:
    """Hang cupboards beside the window."""
    bodies, doors, handles = [], [], []
    front, height = WIDTH - SHELF_DEPTH, SHELF_HIGH - SHELF_LOW
    for x0, x1 in CUPBOARDS:
        bodies.append(span((x0, front, SHELF_LOW), (x1, WIDTH, SHELF_HIGH), 0.002))
        bodies.append(
            span((x0 - 0.015, front - 0.04, SHELF_HIGH), (x1 + 0.015, WIDTH, SHELF_HIGH + 0.03), 0.006)
        )
        count = 2 if x1 - x0 < 1.2 else 4
        leaf, grips = crockery.fronts([(x1 - x0) / count] * count, height)
        doors.append(leaf.at(x0, front, SHELF_LOW))
        handles.append(grips.at(x0, front, SHELF_LOW - height + 0.075))
    writer.mesh("wall-bodies", join(bodies), "lacquer-white")
    writer.mesh("wall-doors", join(doors), "lacquer-cream")
    writer.mesh("wall-handles", join(handles), "brass")


def add_stove(writer: SceneWriter, preset: Preset) -> None:
    """Add the stove with its oven, and the hood above it."""
    x, half, front, n = STOVE, STOVE_WIDTH / 2, WIDTH - DEPTH, 2 * preset.segments
    writer.mesh(
        "stove", span((x - half, front, 0.0), (x + half, WIDTH - 0.01, TOP - 0.005), 0.004), "enamel-black"
    )
    door = span((x - half + 0.03, front - 0.012, 0.2), (x + half - 0.03, front, 0.68), 0.004)
    writer.mesh("oven-door", door, "glass-black")
    metal = [
        tube(
            [(x - 0.22, front - 0.05, 0.64), (x, front - 0.05, 0.64), (x + 0.22, front - 0.05, 0.64)],
            0.009,
            n,
        ),
        span((x - half, front - 0.004, 0.74), (x + half, front + 0.01, 0.86), 0.003),
        span((x - half, front, TOP - 0.005), (x + half, WIDTH - 0.01, TOP + 0.004), 0.002),
    ]
    metal += [
        span((x + s - 0.006, front - 0.05, 0.634), (x + s + 0.006, front, 0.646), 0.002) for s in (-0.2, 0.2)
    ]
    writer.mesh("stove-metal", join(metal), "steel-brushed")
    knob = lathe([(0.0, 0.0), (0.02, 0.0), (0.018, 0.022), (0.0, 0.024)], n).bare().turned(90, "x")
    writer.mesh(
        "stove-knobs", join(knob.at(x + 0.11 * k, front - 0.004, 0.80) for k in range(-2, 3)), "chrome"
    )
    ring = lathe([(0.05, 0.0), (0.10, 0.0), (0.10, 0.012), (0.05, 0.012), (0.05, 0.0)], n).bare()
    places = [(x + a, WIDTH - 0.32 + b) for a in (-0.14, 0.14) for b in (-0.14, 0.14)]
    writer.mesh("hobs", join(ring.at(*p, TOP + 0.004) for p in places), "iron")
    shaft = span((x - 0.14, WIDTH - 0.30, 1.85), (x + 0.14, WIDTH, HEIGHT), 0.004)
    canopy = lathe([(0.0, 0.0), (0.44, 0.0), (0.44, 0.05), (0.2, 0.2)], 4).bare().turned(45)
    canopy = Mesh(canopy.positions * [0.95, 0.78, 1.0], canopy.faces)
    writer.mesh("hood", join([shaft, canopy.at(x, WIDTH - 0.26, 1.68)]), "steel-brushed", crease_deg=20)


def add_fridge(writer: SceneWriter) -> None:
    """Stand a refrigerator of brushed metal in the south-east corner of the worktops."""
    y1 = WIDTH - DEPTH - EAST_RUN - 0.02
    x0, y0 = LENGTH - 0.66, y1 - 0.62
    body = span((x0 + 0.03, y0, 0.03), (LENGTH - 0.01, y1, 1.85), 0.01)
    doors = [span((x0, y0, a), (x0 + 0.04, y1, b), 0.012) for a, b in ((0.05, 0.68), (0.69, 1.84))]
    writer.mesh("fridge", join([body, *doors]), "fridge")
    grips = [
        tube(
            [(x0 - 0.035, y0 + 0.06, a), (x0 - 0.035, y0 + 0.06, (a + b) / 2), (x0 - 0.035, y0 + 0.06, b)],
            0.009,
            12,
        )
        for a, b in ((0.38, 0.62), (0.78, 1.3))
    ]
    grips += [
        span((x0 - 0.035, y0 + 0.054, z), (x0 + 0.002, y0 + 0.066, z + 0.012), 0.002)
        for z in (0.4, 0.6, 0.82, 1.26)
    ]
    writer.mesh("fridge-grips", join(grips), "chrome")


def add_shelves(writer: SceneWriter) -> None:
    """Fix open shelves on the east wall above the worktop."""
    y0, y1 = WIDTH - DEPTH - EAST_RUN + 0.05, WIDTH - 0.45
    boards = [span((LENGTH - 0.26, y0, z - 0.03), (LENGTH, y1, z), 0.004) for z in SHELVES]
    writer.mesh("shelves", box_mapped(join(boards), 0.8, grain="y"), "oak")
    brackets = [
        block((0.2, 0.02, 0.02), 0.003).at(LENGTH - 0.11, y, z - 0.05)
        for z in SHELVES
        for y in (y0 + 0.2, y1 - 0.2)
    ]
    writer.mesh("shelf-brackets", join(brackets), "iron")


def add_door(writer: SceneWriter) -> None:
    """Add the door in the west wall."""
    leaf = joinery.hung(joinery.panelled_door(0.9, 2.05), 0.0, 1.3, 0.02, WEST)
    surround = joinery.hung(joinery.architrave(0.92, 2.06), 0.0, 1.3, 0.0, WEST)
    writer.mesh("door", join([leaf, surround]), "joinery")
