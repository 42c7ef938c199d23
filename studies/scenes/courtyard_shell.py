"""COURTYARD's shell: floors, walls, arcades, doors, sun and sky."""

from __future__ import annotations

import shapely

from studies.scenes import colonnade, joinery, pictures
from studies.scenes.courtyard_plan import (
    BAYS,
    CEILING,
    COLUMN,
    COURT,
    DADO,
    DOOR_HEIGHT,
    DOOR_WIDTH,
    DOORS_EAST,
    DOORS_NORTH,
    LENGTH,
    PARAPET,
    SPRINGING,
    SUN,
    WALL,
    WIDTH,
)
from studies.scenes.joinery import EAST, NORTH, SOUTH, WEST
from studies.scenes.pieces import flat
from studies.scenes.presets import Preset
from studies.scenes.shading import box_mapped
from studies.scenes.solids import Mesh, Point2, arch, join, span
from studies.scenes.writer import SceneWriter

STEP = 0.12  # height of the arcades above the court


def add_floors(writer: SceneWriter) -> None:
    """Add the paved court and the raised floor of the arcades with its stone edge."""
    (x0, y0), (x1, y1) = COURT
    court = flat(x1 - x0, y1 - y0, ((x1 - x0) / 2.6, (y1 - y0) / 2.6))
    writer.mesh("court", court.at(LENGTH / 2, WIDTH / 2, -STEP), "paving")
    writer.mesh("arcade-floor", box_mapped(_surround(-WALL, -STEP - 0.1, 0.0), 2.4), "quarry")


def add_walls(writer: SceneWriter) -> None:
    """Add the outer walls with their tiled dado, and the roofs of the arcades on their beams."""
    (x0, y0), (x1, y1) = COURT
    doors = {"north": DOORS_NORTH, "east": [WIDTH - y for y in DOORS_EAST]}
    plates, tiles = [], []
    for name, along, turn, corner in _sides((0.0, 0.0), (LENGTH, WIDTH)):
        holes = [
            shapely.box(x - DOOR_WIDTH / 2, 0.0, x + DOOR_WIDTH / 2, DOOR_HEIGHT) for x in doors.get(name, ())
        ]
        plate = joinery.wall(shapely.box(-WALL, -0.1, along + WALL, PARAPET), holes, WALL)
        plates.append(box_mapped(plate, 1.8).turned(turn).at(*corner))
        dado = joinery.wall(shapely.box(0.0, 0.0, along, DADO), [hole.buffer(0.1) for hole in holes], 0.012)
        tiles.append(box_mapped(dado.at(0.0, -0.012), 0.5).turned(turn).at(*corner))
    writer.mesh("walls", join(plates), "plaster")
    writer.mesh("dado", join(tiles), "tiles")
    writer.mesh("roof", _surround(-0.02, CEILING, CEILING + 0.15).bare(), "plaster")
    beams = []
    for k in range(14):
        x = (k + 0.5) * LENGTH / 14
        for low, high in ((0.0, y0), (y1, WIDTH)):
            beams.append(span((x - 0.06, low - 0.05, CEILING - 0.16), (x + 0.06, high, CEILING + 0.01)))
    for k in range(7):
        y = y0 + (k + 0.5) * (y1 - y0) / 7
        for low, high in ((0.0, x0), (x1, LENGTH)):
            beams.append(span((low - 0.05, y - 0.06, CEILING - 0.16), (high, y + 0.06, CEILING + 0.01)))
    writer.mesh("beams", box_mapped(join(beams), 0.6, grain="x"), "timber")


def add_arcades(writer: SceneWriter, preset: Preset) -> None:
    """Add the columns with their round arches, and a coping on top."""
    low, high = COURT
    plates, shafts, caps = [], [], []
    for name, along, turn, corner in _sides(low, high):
        bays = BAYS[0] if name in ("north", "south") else BAYS[1]
        bay = along / bays
        radius = bay / 2 - 0.17
        head = shapely.Polygon(arch(2 * radius, radius + 0.1, radius, 3 * preset.segments))
        heads = [shapely.affinity.translate(head, (k + 0.5) * bay, SPRINGING - 0.101) for k in range(bays)]
        outline = shapely.box(-0.2, SPRINGING, along + 0.2, PARAPET)
        plate = joinery.wall(outline, heads, 0.4).at(0.0, -0.2)
        plates.append(box_mapped(plate, 1.6).turned(turn).at(*corner))
        shaft, cap = colonnade.column(SPRINGING, COLUMN, preset.segments)
        for k in range(bays):
            shafts.append(shaft.at(k * bay, 0.0).turned(turn).at(*corner))
            caps.append(cap.at(k * bay, 0.0).turned(turn).at(*corner))
    writer.mesh("arches", join(plates), "ashlar")
    writer.mesh("column-shafts", join(shafts), "marble")
    writer.mesh("column-caps", box_mapped(join(caps), 0.8), "marble")
    coping = [
        span((x0, y0, PARAPET), (x1, y1, PARAPET + 0.08), 0.015)
        for x0, y0, x1, y1 in (
            (low[0] - 0.26, high[1] - 0.26, high[0] + 0.26, high[1] + 0.26),
            (low[0] - 0.26, low[1] - 0.26, high[0] + 0.26, low[1] + 0.26),
            (low[0] - 0.26, low[1] + 0.26, low[0] + 0.26, high[1] - 0.26),
            (high[0] - 0.26, low[1] + 0.26, high[0] + 0.26, high[1] - 0.26),
        )
    ]
    writer.mesh("coping", box_mapped(join(coping), 0.9), "marble")


def add_doors(writer: SceneWriter) -> None:
    """Add glazed doors, their surrounds, and the dark rooms behind."""
    places = [((LENGTH, y), EAST) for y in DOORS_EAST] + [((x, WIDTH), NORTH) for x in DOORS_NORTH]
    half, behind = DOOR_WIDTH / 2, 0.12
    corners = (
        (-half, behind, 0.0),
        (half, behind, 0.0),
        (half, behind, DOOR_HEIGHT),
        (-half, behind, DOOR_HEIGHT),
    )
    parts = {
        "door-frames": (joinery.casement(DOOR_WIDTH, DOOR_HEIGHT, 4, 5, 0.03).at(0.0, 0.09), "joinery"),
        "door-surrounds": (
            joinery.hung(joinery.architrave(DOOR_WIDTH, DOOR_HEIGHT), 0.0, 0.0, 0.0),
            "marble",
        ),
        "door-panes": (colonnade.pane(corners), "glass-pane"),
        "door-rooms": (
            flat(DOOR_WIDTH + 0.4, DOOR_HEIGHT + 0.4).turned(90, "x").at(0.0, WALL + 0.2, DOOR_HEIGHT / 2),
            "dark",
        ),
    }
    for name, (part, material) in parts.items():
        writer.mesh(name, join(part.bare().turned(turn).at(*where) for where, turn in places), material)


def add_daylight(writer: SceneWriter, preset: Preset) -> None:
    """Add sun and sky. The sun is parallel light, as in GALLERY."""
    image = pictures.horizon(preset.texture // 4, 1.5, SUN, north=1.0)
    writer.environment(writer.radiance("horizon", image[::-1]), weight=1.5)
    writer.sun(SUN, "#fff0d6", 8.0)


def _sides(low: Point2, high: Point2) -> list[tuple[str, float, float, Point2]]:
    """Return name, length, turn and first corner of the sides of a rectangle, seen from within."""
    length, width = high[0] - low[0], high[1] - low[1]
    return [
        ("north", length, NORTH, (low[0], high[1])),
        ("west", width, WEST, low),
        ("south", length, SOUTH, (high[0], low[1])),
        ("east", width, EAST, high),
    ]


def _surround(margin: float, low: float, high: float) -> Mesh:
    """Return a slab over the arcades, from the outer walls (beyond them by `-margin`) to the court."""
    (x0, y0), (x1, y1) = COURT
    return join(
        [
            span((margin, margin, low), (LENGTH - margin, y0, high), 0.008),
            span((margin, y1, low), (LENGTH - margin, WIDTH - margin, high), 0.008),
            span((margin, y0, low), (x0, y1, high), 0.008),
            span((x1, y0, low), (LENGTH - margin, y1, high), 0.008),
        ]
    )
