"""Contents of COURTYARD: the basin, plants, the laid table and lanterns."""

from __future__ import annotations

from studies.scenes import crockery, furniture, objects
from studies.scenes.courtyard_plan import BASIN, CEILING, TABLE
from studies.scenes.courtyard_shell import STEP
from studies.scenes.pieces import pose
from studies.scenes.presets import Preset
from studies.scenes.shading import box_mapped
from studies.scenes.solids import join, lathe
from studies.scenes.writer import SceneWriter

# Pots: x, y, z, scale, height of the plant, leaves.
POTS = (
    (5.9, 8.15, -STEP, 1.1, 0.95, 30),
    (9.85, 8.1, -STEP, 1.2, 1.1, 34),
    (5.2, 10.8, 0.0, 0.8, 0.6, 24),
    (9.9, 3.2, -STEP, 1.1, 0.9, 28),
    (12.5, 5.6, 0.0, 1.2, 1.2, 32),
    (11.9, 10.7, 0.0, 1.0, 1.0, 28),
)
TREES = ((8.6, 4.2, 3.4, 3), (3.7, 7.8, 2.6, 17))  # x, y, height, seed
SEATS = ((7.5, 9.2, 178), (8.5, 9.15, 185), (7.45, 10.5, 4), (8.55, 10.5, -8), (9.3, 9.8, -92))
PLACES = ((7.55, 9.6), (8.45, 9.58), (7.55, 10.1), (8.45, 10.12))


def add_basin(writer: SceneWriter, preset: Preset) -> None:
    """Add the round basin with its water and a bowl in the middle."""
    n, (x, y) = 6 * preset.segments, BASIN
    rim = [(0.0, 0.0), (1.05, 0.0), (1.08, 0.03), (1.0, 0.08), (0.98, 0.36), (1.06, 0.4), (1.07, 0.45),
           (0.86, 0.46), (0.84, 0.42), (0.84, 0.1), (0.0, 0.1)]  # fmt: skip
    stem = [(0.0, 0.1), (0.16, 0.1), (0.13, 0.2), (0.07, 0.3), (0.07, 0.7), (0.12, 0.8), (0.38, 0.92),
            (0.42, 0.98), (0.4, 0.985), (0.3, 0.92), (0.0, 0.88)]  # fmt: skip
    stone = join([lathe(rim, n), lathe(stem, n)])
    writer.mesh("basin", box_mapped(stone, 1.1).at(x, y, -STEP), "marble")
    water = join([lathe([(0.0, 0.39), (0.845, 0.39)], n), lathe([(0.0, 0.95), (0.345, 0.95)], n)])
    writer.mesh("water", water.bare().at(x, y, -STEP), "water")


def add_plants(writer: SceneWriter, preset: Preset) -> None:
    """Plant trees in tubs and stand pots along the arcades."""
    n = preset.segments
    tubs, soils, trunks, crowns = [], [], [], []
    for x, y, height, seed in TREES:
        tubs.append(objects.vase("pot", 4 * n, 1.6).at(x, y, -STEP))
        trunk, crown = objects.tree(height, seed, 10, n)
        trunks.append(trunk.at(x, y, 0.5 - STEP))
        crowns.append(crown.at(x, y, 0.5 - STEP))
        soils.append(lathe([(0.0, 0.52), (0.29, 0.52)], 3 * n).bare().at(x, y, -STEP))
    writer.mesh("tubs", join(tubs), "glaze-blue")
    writer.mesh("trunks", join(part.bare() for part in trunks), "bark")
    writer.mesh("crowns", join(part.bare() for part in crowns), "leaf-dark", crease_deg=60)
    pots, plants = [], []
    for k, (x, y, z, scale, height, leaves) in enumerate(POTS):
        pots.append(objects.vase("pot", 3 * n, scale).at(x, y, z))
        soils.append(lathe([(0.0, 0.325 * scale), (0.183 * scale, 0.325 * scale)], 2 * n).bare().at(x, y, z))
        plants.append(objects.foliage(leaves, height, 0.5 * height, 60 + k).at(x, y, z + 0.325 * scale))
    writer.mesh("pots", join(pots), "terracotta")
    writer.mesh("soil", join(soils), "soil")
    writer.mesh("plants", join(part.bare() for part in plants), "leaf", crease_deg=60)


def add_table(writer: SceneWriter, preset: Preset) -> None:
    """Lay a table for four under the north arcade."""
    n, (x, y), top = preset.segments, TABLE, 0.75
    writer.mesh("table", box_mapped(furniture.table(1.9, 0.9, top, n), 0.9, grain="x").at(x, y), "oak")
    cloth = furniture.tablecloth(1.86, 0.86, top, 0.2, 6 * n).tiled(10.0, 5.0)
    writer.mesh("tablecloth", cloth.at(x, y), "cloth", crease_deg=70)
    stored = writer.store("chair", box_mapped(furniture.chair(n), 0.5, grain="z"))
    for k, seat in enumerate(SEATS):
        writer.place(f"chair-{k}", stored, "oak", pose(*seat))
    top += 0.007
    writer.mesh("plates", join(crockery.plate(0.13, n).at(px, py, top) for px, py in PLACES), "enamel-white")
    glasses = join(crockery.tumbler(n).at(px + 0.2, py, top + 0.0005) for px, py in PLACES)
    writer.mesh("tumblers", glasses, "glass")
    writer.mesh("fruit-bowl", objects.vase("bowl", 3 * n).at(x, y, top), "copper")
    writer.mesh("fruit", objects.fruit(9, 0.042, 5, 2 * n).at(x, y, top), "orange")
    jug = objects.vase("jar", 3 * n, 0.8).at(x - 0.45, y, top)
    writer.mesh("jug", jug, "glaze-blue")


def add_lanterns(writer: SceneWriter, preset: Preset) -> None:
    """Hang two lamps over the table."""
    rim = 2.0
    parts = objects.pendant(CEILING - rim, preset.segments)
    names = {"lantern-shades": "copper", "lantern-fittings": "brass", "bulbs": "glow"}
    for (name, material), part in zip(names.items(), parts, strict=True):
        places = [(TABLE[0] + d, TABLE[1]) for d in (-0.55, 0.55)]
        writer.mesh(name, join(part.bare().at(px, py, rim) for px, py in places), material)
    writer.light("#ffd6a0", 25.0, weight=0.3)
