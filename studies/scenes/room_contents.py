"""Contents of ROOM: tables, chairs, lamps, sofa, books, sideboard and plants."""

from __future__ import annotations

import numpy as np

from studies.scenes import furniture, joinery, objects
from studies.scenes.joinery import EAST
from studies.scenes.pieces import flat, hang_picture, pose
from studies.scenes.presets import Preset
from studies.scenes.room_plan import BOOKS, HEIGHT, LAMP_RIM, LAMPS, LENGTH, TABLE, WIDTH
from studies.scenes.shading import box_mapped
from studies.scenes.solids import Mesh, cushion, extrude, join, span
from studies.scenes.writer import SceneWriter


def add_dining(writer: SceneWriter, preset: Preset) -> None:
    """Add the laid table and its five chairs."""
    x, y = TABLE
    table = furniture.table(1.9, 0.95, 0.75, preset.segments)
    writer.mesh("table", box_mapped(table, 0.8).at(x, y), "walnut")
    cloth = furniture.tablecloth(1.86, 0.91, 0.75, 0.24, 6 * preset.segments)
    cloth = cloth.tiled(10.0, 6.0)
    writer.mesh("tablecloth", cloth.at(x, y), "cloth", crease_deg=70)
    stored = writer.store("chair", box_mapped(furniture.chair(preset.segments), 0.5, grain="z"))
    seats = [(1.62, 1.72, 180), (2.55, 1.66, 172), (1.60, 3.20, 4), (2.52, 3.22, -6), (0.82, 2.48, 92)]
    for k, (cx, cy, turn) in enumerate(seats):
        writer.place(f"chair-{k}", stored, "oak", pose(cx, cy, turn))
        pad = cushion((0.40, 0.38, 0.06), 2 * preset.segments).turned(turn).at(cx, cy, 0.458)
        writer.mesh(f"chair-cushion-{k}", pad, "gingham-blue")
    top = 0.757
    writer.mesh("fruit-bowl", objects.vase("bowl", 3 * preset.segments).at(x, y, top), "glaze-blue")
    writer.mesh("fruit", objects.fruit(8, 0.042, 3, preset.segments).at(x, y, top), "orange")
    jug = objects.vase("jar", 2 * preset.segments, 0.8).at(x - 0.45, y + 0.12, top)
    writer.mesh("jug", jug, "glaze-cream")


def add_lamps(writer: SceneWriter, preset: Preset) -> None:
    """Hang two lamps over the table; the walk passes close by one. Stand one by the sofa."""
    bulbs = []
    for k, (x, y) in enumerate(LAMPS):
        shade, fittings, bulb = objects.pendant(HEIGHT - LAMP_RIM, preset.segments)
        writer.mesh(f"pendant-{k}", shade.at(x, y, LAMP_RIM), "shade")
        writer.mesh(f"pendant-fittings-{k}", fittings.at(x, y, LAMP_RIM), "brass")
        bulbs.append(bulb.at(x, y, LAMP_RIM))
        rose = joinery.rosette(0.34, 12, 6 * preset.segments).at(x, y, HEIGHT)
        writer.mesh(f"ceiling-rose-{k}", rose, "plaster", crease_deg=70)
    writer.mesh("bulbs", join(bulbs), "bulb")
    writer.light("#ffd9a0", 4.0, weight=0.6)
    stand, cloth = objects.floor_lamp(preset.segments)
    writer.mesh("floor-lamp", stand.at(6.72, 1.25), "brass")
    writer.mesh("floor-lamp-shade", cloth.at(6.72, 1.25), "shade-cloth", crease_deg=80)
    writer.light("#ffcf8f", 1.1, weight=0.4)


def add_seating(writer: SceneWriter, preset: Preset) -> None:
    """Add the sofa with its cushions, the rug and the low table."""
    n = preset.segments
    writer.mesh("rug", flat(2.9, 2.0).at(5.2, 3.15, 0.012), "rug")
    body, feet = furniture.sofa(2.15, n)
    writer.mesh("sofa", body.turned(180).at(5.2, 1.72), "sofa")
    writer.mesh("sofa-feet", feet.turned(180).at(5.2, 1.72), "walnut-edge")
    throws = (("gingham-ochre", 4.62, 20), ("gingham-blue", 5.78, -16), ("cloth", 5.42, 6))
    for k, (cloth, x, turn) in enumerate(throws):
        pad = cushion((0.42, 0.42, 0.15), 3 * n).turned(-66, "x").turned(turn)
        writer.mesh(f"cushion-{k}", pad.at(x, 1.70, 0.66), cloth)
    low = furniture.round_table(0.44, 0.42, n).at(5.2, 3.15)
    writer.mesh("low-table", box_mapped(low, 0.9), "walnut")
    for k, (size, turn) in enumerate((((0.30, 0.22, 0.03), 20), ((0.26, 0.19, 0.035), 34))):
        tome = span((-size[0] / 2, -size[1] / 2, 0), (size[0] / 2, size[1] / 2, size[2]))
        writer.mesh(f"tome-{k}", tome.turned(turn).at(5.06, 3.05, 0.421 + 0.031 * k), f"book-{1 + k}")
    writer.mesh("low-table-bowl", objects.vase("bowl", 2 * n, 0.75).at(5.36, 3.28, 0.421), "glaze-cream")


def add_library(writer: SceneWriter) -> None:
    """Add two bookcases on the north wall, filled with books."""
    size = (1.3, 0.3, 2.15)
    stored = writer.store("bookcase", box_mapped(furniture.bookcase(size, 6), 0.7, grain="z"))
    rows: dict[int, list[Mesh]] = {k: [] for k in range(len(BOOKS))}
    for case, x in enumerate((1.55, 2.92)):
        y = WIDTH - 0.16
        writer.place(f"bookcase-{case}", stored, "walnut", pose(x, y, 0))
        for shelf, z in enumerate(furniture.shelf_heights(size[2], 6)):
            for half, start in enumerate((x - 0.61, x + 0.025)):
                seed = 100 * case + 10 * shelf + half
                row = furniture.books((start, y - 0.10, z + 0.012), 0.58, len(BOOKS), seed)
                for colour, volumes in enumerate(row):
                    rows[colour].append(volumes)
    for colour, shelved in rows.items():
        writer.mesh(f"books-{colour}", join(shelved), f"book-{colour}")


def furnish_east_wall(writer: SceneWriter, preset: Preset) -> None:
    """Add the sideboard with its vessels, and the pictures above it."""
    n, x, y = preset.segments, LENGTH - 0.25, 3.1
    body, knobs = furniture.sideboard(1.9, n)
    writer.mesh("sideboard", box_mapped(body, 0.9, grain="z").turned(EAST).at(x, y), "oak")
    writer.mesh("sideboard-knobs", knobs.turned(EAST).at(x, y), "walnut-edge")
    vessels = (
        ("jar", "glaze-blue", -0.68, 1.25),
        ("bottle", "glaze-ochre", -0.36, 1.2),
        ("bowl", "terracotta", 0.12, 1.0),
        ("bottle", "glaze-cream", 0.72, 1.5),
    )
    for k, (kind, colour, along, scale) in enumerate(vessels):
        vessel = objects.vase(kind, 2 * n, scale).at(x, y + along, 0.85)
        writer.mesh(f"vessel-{k}", vessel, colour)
    hang_picture(writer, "east-picture", "painting-discs", (0.85, 0.85), (LENGTH, 3.1, 1.82), EAST)
    for k, along in enumerate((2.16, 4.04)):
        hang_picture(writer, f"print-{k}", "painting-stem", (0.36, 0.5), (LENGTH, along, 1.85), EAST)


def add_plants(writer: SceneWriter, preset: Preset) -> None:
    """Stand a tall plant in the corner by the windows and a small one on the sill."""
    n = preset.segments
    places = ((0.50, 4.98, 1.15, 1.25, 0.70, 26), (6.75, 4.95, 1.0, 0.85, 0.42, 22))
    for k, (x, y, scale, height, spread, leaves) in enumerate(places):
        writer.mesh(f"plant-pot-{k}", objects.vase("pot", 3 * n, scale).at(x, y), "terracotta")
        soil = extrude(
            [
                (0.17 * scale * float(np.cos(a)), 0.17 * scale * float(np.sin(a)))
                for a in np.linspace(0, 2 * np.pi, 17)[:-1]
            ],
            0.01,
        )
        writer.mesh(f"plant-soil-{k}", soil.at(x, y, 0.335 * scale), "earth")
        green = objects.foliage(leaves, height, spread, 40 + k)
        writer.mesh(f"plant-leaves-{k}", green.at(x, y, 0.33 * scale), "leaf", crease_deg=60)
