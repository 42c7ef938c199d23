"""Contents of KITCHEN: the laid table, chairs, jars, tins, pans, crockery and plants."""

from __future__ import annotations

from collections.abc import Iterable

from studies.scenes import crockery, furniture, objects
from studies.scenes.kitchen_plan import DEPTH, LENGTH, STOVE, TABLE, TABLE_SIZE, TOP, WIDTH
from studies.scenes.kitchen_units import EAST_RUN, SHELVES
from studies.scenes.pieces import pose
from studies.scenes.presets import Preset
from studies.scenes.shading import box_mapped
from studies.scenes.solids import Mesh, Vector, block, join, lathe, span
from studies.scenes.sweeps import tube
from studies.scenes.writer import SceneWriter

# Jars: x, y, radius, height, fill, contents.
JARS = (
    (0.35, WIDTH - 0.2, 0.062, 0.24, 0.8, "pasta"),
    (0.52, WIDTH - 0.19, 0.055, 0.19, 0.6, "lentils"),
    (0.67, WIDTH - 0.2, 0.050, 0.15, 0.9, "flour"),
    (0.81, WIDTH - 0.21, 0.045, 0.13, 0.5, "paprika"),
    (3.62, WIDTH - 0.18, 0.062, 0.22, 0.7, "lentils"),
    (3.79, WIDTH - 0.19, 0.055, 0.26, 0.85, "pasta"),
)
SEATS = ((2.35, 1.2, 182), (3.45, 1.18, 176), (2.4, 2.72, 4), (3.5, 2.68, -10), (1.62, 1.98, 94))
PLACES = ((2.35, 1.68, 25), (3.45, 1.68, -30), (2.4, 2.22, 160), (3.45, 2.22, 200))


def add_dining(writer: SceneWriter, preset: Preset) -> None:
    """Add the table of varnished oak with its chairs, laid for four."""
    n, (x, y), top = preset.segments, TABLE, TABLE_SIZE[2]
    table = box_mapped(furniture.table(*TABLE_SIZE, n), 0.9, grain="x")
    writer.mesh("table", table.at(x, y), "oak-varnished")
    stored = writer.store("chair", box_mapped(furniture.chair(n), 0.5, grain="z"))
    for k, (cx, cy, turn) in enumerate(SEATS):
        writer.place(f"chair-{k}", stored, "oak", pose(cx, cy, turn))
    plate, small = crockery.plate(0.135, n), crockery.plate(0.07, n)
    writer.mesh("plates", join(plate.at(px, py, top) for px, py, _ in PLACES), "porcelain")
    cups, saucers, glasses = [], [], []
    for px, py, turn in PLACES:
        inward = 0.12 if py < y else -0.12
        saucers.append(small.at(px + 0.19, py + inward, top))
        cups.append(crockery.cup(n).turned(turn).at(px + 0.19, py + inward, top + 0.004))
        glasses.append(crockery.tumbler(n).at(px - 0.17, py + inward, top + 0.0005))
    writer.mesh("saucers", join(saucers), "porcelain")
    writer.mesh("cups", join(cups), "glaze-teal")
    writer.mesh("tumblers", join(glasses), "glass")
    writer.mesh("fruit-bowl", objects.vase("bowl", 3 * n).at(x, y, top), "enamel-white")
    writer.mesh("fruit", objects.fruit(8, 0.042, 3, 2 * n).at(x, y, top), "orange")
    pot = crockery.saucepan(0.085, 0.1, n).at(x + 0.42, y + 0.02, top + 0.004)
    writer.mesh("table-pan", pot, "copper")
    candle = lathe(
        [(0.0, 0.0), (0.05, 0.0), (0.045, 0.012), (0.012, 0.02), (0.012, 0.16), (0.02, 0.18), (0.0, 0.18)], n
    )
    writer.mesh("candlesticks", join(candle.bare().at(x - 0.4, y + d, top) for d in (-0.07, 0.08)), "gold")


def add_jars(writer: SceneWriter, preset: Preset) -> None:
    """Stand glass jars with their contents on the worktop, below the lamps."""
    goods: dict[str, list[Mesh]] = {}
    walls, lids = [], []
    for x, y, radius, height, fill, content in JARS:
        wall, inside, lid = crockery.jar(radius, height, fill, preset.segments)
        walls.append(wall.at(x, y, TOP + 0.001))
        lids.append(lid.at(x, y, TOP + 0.001))
        goods.setdefault(content, []).append(inside.at(x, y, TOP + 0.001))
    writer.mesh("jars", join(walls), "glass-pane")
    writer.mesh("jar-lids", join(lids), "steel-brushed")
    for content, meshes in goods.items():
        writer.mesh(f"jar-{content}", join(meshes), content)


def add_worktop_things(writer: SceneWriter, preset: Preset) -> None:
    """Add pans on the stove, boards, bottles, a kettle and a rail of ladles."""
    n, back = preset.segments, WIDTH - 0.32
    writer.mesh(
        "pan-copper",
        crockery.saucepan(0.11, 0.13, n).turned(35).at(STOVE - 0.14, back + 0.14, TOP + 0.016),
        "copper",
    )
    writer.mesh(
        "pan-steel",
        crockery.saucepan(0.10, 0.09, n).turned(-50).at(STOVE + 0.14, back - 0.14, TOP + 0.016),
        "chrome",
    )
    boards = [span((1.05, WIDTH - 0.05, TOP), (1.35, WIDTH - 0.025, TOP + 0.40), 0.006)]
    boards.append(span((3.0 + 0.32, WIDTH - 0.5, TOP), (3.0 + 0.75, WIDTH - 0.3, TOP + 0.022), 0.005))
    writer.mesh("boards", box_mapped(join(boards), 0.5, grain="z"), "oak")
    bottles = [objects.vase("bottle", 2 * n, 0.75).at(x, WIDTH - 0.16, TOP) for x in (1.5, 4.12)]
    writer.mesh("bottles", join(m.bare() for m in bottles), "glaze-green")
    kettle = [
        lathe(
            [(0.0, 0.0), (0.10, 0.0), (0.105, 0.01), (0.085, 0.13), (0.05, 0.165), (0.0, 0.17)], 3 * n
        ).bare(),
        lathe([(0.0, 0.165), (0.014, 0.17), (0.016, 0.185), (0.0, 0.195)], 2 * n).bare(),
        tube([(0.07, 0.0, 0.07), (0.12, 0.0, 0.11), (0.145, 0.0, 0.16)], (0.018, 0.014, 0.010), n),
        tube(
            [(-0.06, 0, 0.15), (-0.05, 0, 0.23), (0.0, 0, 0.25), (0.05, 0, 0.23), (0.06, 0, 0.15)], 0.008, n
        ),
    ]
    writer.mesh("kettle", join(kettle).turned(-120).at(1.72, WIDTH - 0.3, TOP), "chrome", crease_deg=50)
    rail = [tube([(3.4, WIDTH - 0.05, 1.32), (3.8, WIDTH - 0.05, 1.32), (4.3, WIDTH - 0.05, 1.32)], 0.006, n)]
    for x in (3.95, 4.07, 4.19):
        rail.append(
            tube([(x, WIDTH - 0.06, 1.33), (x, WIDTH - 0.06, 1.2), (x, WIDTH - 0.06, 1.09)], 0.004, n)
        )
        rail.append(
            lathe([(0.0, -0.03), (0.022, -0.02), (0.032, 0.0), (0.029, 0.0), (0.0, -0.024)], n)
            .bare()
            .at(x, WIDTH - 0.08, 1.08)
        )
    writer.mesh("ladles", join(rail), "chrome")
    pot = objects.vase("pot", 2 * n, 0.38).at(2.98, WIDTH - 0.035, 1.12)
    writer.mesh("herb-pot", pot, "terracotta")
    writer.mesh(
        "herbs",
        objects.foliage(22, 0.2, 0.11, 12, 0.014).at(2.98, WIDTH - 0.035, 1.24),
        "leaf",
        crease_deg=60,
    )


def add_shelf_things(writer: SceneWriter, preset: Preset) -> None:
    """Fill the open shelves and the east worktop with tins, cups, bowls and plates."""
    n, x = preset.segments, LENGTH - 0.13
    y0 = WIDTH - DEPTH - EAST_RUN + 0.2
    lower, upper = SHELVES
    cup, bowl = crockery.cup(n), objects.vase("bowl", 2 * n, 0.5).bare()
    _scatter(writer, "shelf-cups", cup, "porcelain", [(x, y0 + 0.13 * k, lower) for k in range(5)])
    stack = [(x, y0 + 0.85, lower + 0.022 * k) for k in range(4)]
    _scatter(writer, "shelf-bowls", bowl, "glaze-teal", stack)
    tins = [crockery.tin(0.06 - 0.006 * k, 0.18 - 0.025 * k, n) for k in range(4)]
    for part, material in enumerate(("enamel-red", "gold")):
        row = [tin[part].at(x, y0 + 0.05 + 0.15 * k, upper) for k, tin in enumerate(tins)]
        writer.mesh(f"shelf-tins-{part}", join(row), material)
    plates = crockery.plate(0.12, n).turned(-78, "y")
    _scatter(
        writer,
        "shelf-plates",
        plates,
        "porcelain",
        [(x + 0.09, y0 + 0.9 + 0.26 * k, upper + 0.12) for k in range(2)],
    )
    _scatter(
        writer, "east-cups", cup.turned(120), "glaze-teal", [(x - 0.2, y0 + 0.15 * k, TOP) for k in range(3)]
    )
    body, lid = crockery.tin(0.075, 0.22, n)
    spots = [(x, y0 + 0.75, TOP), (x, y0 + 0.95, TOP)]
    _scatter(writer, "canisters", body, "enamel-white", spots)
    _scatter(writer, "canister-lids", lid, "copper", spots)
    box = block((0.20, 0.33, 0.21), 0.02).at(x - 0.1, WIDTH - 0.45, TOP)
    writer.mesh("toaster", box, "steel-brushed")


def add_plant(writer: SceneWriter, preset: Preset) -> None:
    """Stand a plant in the south-west corner."""
    n = preset.segments
    writer.mesh("plant-pot", objects.vase("pot", 3 * n, 0.9).at(0.42, 0.45), "terracotta")
    green = objects.foliage(24, 1.05, 0.5, 41).at(0.42, 0.45, 0.29)
    writer.mesh("plant-leaves", green, "leaf", crease_deg=60)


def _scatter(writer: SceneWriter, name: str, mesh: Mesh, material: str, spots: Iterable[Vector]) -> None:
    """Add copies of a mesh at points, as one shape."""
    writer.mesh(name, join(mesh.at(*spot) for spot in spots), material)
