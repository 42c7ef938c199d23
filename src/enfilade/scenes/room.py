"""ROOM: a furnished room of matte, chequered surfaces, walked at a changing pace (§6).

The eye rests, crosses the room close by a hanging lamp, turns fast, and rests again. Every
material is diffuse. x runs east, y north; the windows look west.
"""

from __future__ import annotations

import numpy as np
import shapely

from enfilade.scenes import furniture, joinery, objects, pictures, textures
from enfilade.scenes.joinery import EAST, NORTH, SOUTH, WEST
from enfilade.scenes.materials import Material
from enfilade.scenes.presets import Preset
from enfilade.scenes.shading import box_mapped
from enfilade.scenes.solids import Floats, Mesh, cushion, extrude, extrude_parts, join, span, sphere, surface
from enfilade.scenes.sweeps import frame, moulding, tube
from enfilade.scenes.walk import Walk
from enfilade.scenes.writer import SceneWriter

LENGTH, WIDTH, HEIGHT = 7.2, 5.4, 2.9
DADO_HEIGHT = 0.95
WINDOWS, WINDOW_WIDTH, SILL, HEAD = (1.55, 3.85), 1.45, 0.5, 2.45  # centres along y
HEARTH_X, TABLE, LAMPS = 5.2, (2.1, 2.45), ((1.5, 2.45), (2.75, 2.45))
LAMP_RIM = 1.50
LANTERN = ((3.45, 1.75), (6.15, 3.65))  # the roof light, corners in plan

MATTE = {
    "plaster": "#f1ece1",
    "joinery": "#eee8da",
    "walnut-edge": "#5b3d29",
    "soot": "#2b2724",
    "curtain": "#b9573f",
    "sofa": "#3f6a6b",
    "gilt": "#b08a4a",
    "mount": "#efe9dc",
    "shade": "#2f5d57",
    "shade-cloth": "#f1d9b0",
    "bulb": "#fff3dd",
    "brass": "#a9864c",
    "terracotta": "#b5694a",
    "leaf": "#4c7040",
    "glaze-blue": "#39648c",
    "glaze-cream": "#e9dfc8",
    "glaze-ochre": "#cf9440",
    "orange": "#e08a2e",
    "earth": "#4a3a2c",
    "rope": "#3a342e",
}
BOOKS = ("#7b2d2b", "#2f4d6a", "#3f5a3c", "#c59a4a", "#e2d6bd", "#59395a", "#b5643c")


def furnish(writer: SceneWriter, preset: Preset) -> None:
    """Build the whole room."""
    _materials(writer, preset)
    _shell(writer)
    _lantern(writer)
    _windows(writer, preset)
    _hearth(writer, preset)
    _dining(writer, preset)
    _lamps(writer, preset)
    _seating(writer, preset)
    _library(writer)
    _east_wall(writer, preset)
    _walls_dressed(writer)
    _plants(writer, preset)


def walk(preset: Preset) -> tuple[Walk, int]:
    """Return the camera's walk and its number of frames."""
    stations = [
        ((6.55, 0.62, 1.62), (2.6, 3.55, 0.98)),
        ((5.35, 0.72, 1.60), (2.0, 3.40, 1.08)),
        ((4.10, 1.00, 1.56), (1.3, 3.00, 1.20)),
        ((3.52, 1.95, 1.52), (1.0, 3.30, 1.22)),
        ((3.62, 2.95, 1.50), (2.9, 5.40, 1.20)),
        ((4.00, 3.75, 1.48), (5.7, 5.40, 1.12)),
        ((4.45, 4.20, 1.46), (7.1, 3.10, 1.05)),
        ((5.50, 4.42, 1.52), (4.9, 0.80, 0.85)),
        ((6.60, 4.75, 1.62), (2.7, 1.75, 0.90)),
    ]
    if preset.is_small:
        pace = [(0.0, 0.015), (0.27, 0.015), (0.62, 1.0), (0.80, 1.0), (1.0, 0.25)]
        return Walk(stations, pace, reach=0.29), 60
    pace = [
        (0.0, 0.022),
        (0.12, 0.022),
        (0.25, 0.8),
        (0.34, 0.75),
        (0.42, 0.006),
        (0.50, 0.006),
        (0.60, 1.0),
        (0.66, 1.0),
        (0.73, 0.15),
        (0.79, 0.9),
        (0.85, 0.7),
        (0.94, 0.02),
        (1.0, 0.02),
    ]
    return Walk(stations, pace), 448


def _materials(writer: SceneWriter, preset: Preset) -> None:
    """Declare every finish of the room; all of them are matte."""
    big, mid = preset.texture, preset.texture // 2
    for name, colour in MATTE.items():
        writer.material(name, Material("matte", colour))
    for k, colour in enumerate(BOOKS):
        writer.material(f"book-{k}", Material("matte", colour))
    images = {
        "floor": textures.chequer(big, ("#e6ddca", "#4d4a46"), 8, 11),
        "rug": textures.rug(big, ("#e8dabd", "#b0503b", "#2f5364", "#33303a")),
        "wallpaper": textures.trellis(mid, "#d9dcc5", "#a9b394", "#7f9173"),
        "tile": textures.glazed(mid, "#efe8d8", "#2f5d8c", "#c98b3c"),
        "cloth": textures.gingham(mid, "#b8433c", "#f4efe4", 2),
        "gingham-blue": textures.gingham(mid, "#3d628c", "#f2ede0", 4),
        "gingham-ochre": textures.gingham(mid, "#cf9440", "#f4ecd9", 3),
        "walnut": textures.wood(mid, "#4b2f1f", "#8a6142", 5),
        "oak": textures.wood(mid, "#8a6540", "#c59a68", 9),
        "painting-hills": pictures.landscape(mid),
        "painting-discs": pictures.composition(mid),
        "painting-stem": pictures.botanical(mid),
    }
    for name, image in images.items():
        writer.material(name, Material("matte", writer.texture(name, image)))


def _flat(width: float, height: float, uv: tuple[float, float] = (1.0, 1.0)) -> Mesh:
    """Return a rectangle face up in the xy plane, textured `uv` times, upright in its own frame."""
    mesh = surface(lambda u, v: (width * (u - 0.5), height * (v - 0.5), 0.0 * u), 1, 1)
    assert mesh.uvs is not None  # noqa: S101 - surfaces always have them
    return Mesh(mesh.positions, mesh.faces, mesh.uvs * np.array(uv))


def _shell(writer: SceneWriter) -> None:
    """Add floor, ceiling, walls and their mouldings."""
    floor = _flat(LENGTH, WIDTH, (LENGTH / 3.6, WIDTH / 3.6)).at(LENGTH / 2, WIDTH / 2)
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


def _lantern(writer: SceneWriter) -> None:
    """Open the ceiling to a roof light with glazing bars; most of the light comes from it."""
    (x0, y0), (x1, y1) = LANTERN
    walls = [
        span((x0 - 0.1, y0 - 0.1, HEIGHT), (x0, y1 + 0.1, HEIGHT + 0.5)),
        span((x1, y0 - 0.1, HEIGHT), (x1 + 0.1, y1 + 0.1, HEIGHT + 0.5)),
        span((x0 - 0.1, y0 - 0.1, HEIGHT), (x1 + 0.1, y0, HEIGHT + 0.5)),
        span((x0 - 0.1, y1, HEIGHT), (x1 + 0.1, y1 + 0.1, HEIGHT + 0.5)),
    ]
    bars = [
        span((x - 0.025, y0, HEIGHT + 0.36), (x + 0.025, y1, HEIGHT + 0.42))
        for x in np.linspace(x0, x1, 6)[1:-1]
    ]
    bars += [
        span((x0, y - 0.025, HEIGHT + 0.36), (x1, y + 0.025, HEIGHT + 0.42))
        for y in np.linspace(y0, y1, 4)[1:-1]
    ]
    line = [(x0, y0), (x0, y1), (x1, y1), (x1, y0)]
    rim = moulding(joinery.CORNICE, line, closed=True).at(0, 0, HEIGHT + 0.01)
    writer.mesh("lantern", join([*walls, *bars, rim]), "plaster")
    sky = _flat(x1 - x0, y1 - y0).turned(180, "x")
    writer.mesh("lantern-sky", sky.at((x0 + x1) / 2, (y0 + y1) / 2, HEIGHT + 0.48), "plaster")
    writer.light("#f4f8ff", 9.5, share=3.0)


def _windows(writer: SceneWriter, preset: Preset) -> None:
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
    garden = _flat(9.0, 4.0).turned(90, "x").turned(WEST).at(-1.9, WIDTH / 2, 1.15)
    writer.mesh("garden", garden, "soot")
    writer.light(writer.radiance("garden", pictures.garden(preset.texture // 4, 1.6)))
    writer.sun((0.72, 0.2, -1.0), "#fff0d2", 5.0)


def _hearth(writer: SceneWriter, preset: Preset) -> None:
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
    writer.mesh("firebox", span((x - 0.37, y - 0.012, 0.03), (x + 0.37, y - 0.002, 0.73)), "soot")
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
                (x - 0.24, y - 0.08 - 0.05 * k, 0.09 + 0.05 * (k == 1)),
                (x, y - 0.09, 0.10 + 0.06 * (k == 1)),
                (x + 0.24, y - 0.13 + 0.05 * k, 0.09 + 0.05 * (k == 1)),
            ],
            0.042,
            preset.segments,
        )
        for k in range(3)
    ]
    writer.mesh("logs", join(logs), "walnut-edge")
    _picture(writer, "mantel-picture", "painting-hills", (1.15, 0.80), (x, y, 1.98), NORTH)
    n = 2 * preset.segments
    for k, (kind, colour, dx) in enumerate(
        (("bottle", "glaze-blue", -0.82), ("jar", "glaze-ochre", 0.78), ("bottle", "glaze-cream", 0.56))
    ):
        vessel = objects.vase(kind, n, 0.9).at(x + dx, y - 0.15, 1.265)
        writer.mesh(f"mantel-vase-{k}", vessel, colour)


def _picture(
    writer: SceneWriter,
    name: str,
    painting: str,
    size: tuple[float, float],
    where: tuple[float, float, float],
    on_wall: float,
) -> None:
    """Hang a framed and mounted painting, centred on a point of a wall."""
    width, height = size
    gilt = frame(width + 0.1, height + 0.1, joinery.GILT)
    writer.mesh(f"{name}-frame", joinery.hung(gilt, *where, on_wall), "gilt")
    canvas = _flat(width, height).at(0, 0, 0.006)
    writer.mesh(name, joinery.hung(canvas, *where, on_wall), painting)


def _dining(writer: SceneWriter, preset: Preset) -> None:
    """Add the laid table and its five chairs."""
    x, y = TABLE
    table = furniture.table(1.9, 0.95, 0.75, preset.segments)
    writer.mesh("table", box_mapped(table, 0.8).at(x, y), "walnut")
    cloth = furniture.tablecloth(1.86, 0.91, 0.75, 0.24, 6 * preset.segments)
    assert cloth.uvs is not None  # noqa: S101 - surfaces always have them
    cloth = Mesh(cloth.positions, cloth.faces, cloth.uvs * np.array([10.0, 6.0]))
    writer.mesh("tablecloth", cloth.at(x, y), "cloth", crease_deg=70)
    stored = writer.store("chair", box_mapped(furniture.chair(preset.segments), 0.5, grain="z"))
    seats = [(1.62, 1.72, 180), (2.55, 1.66, 172), (1.60, 3.20, 4), (2.52, 3.22, -6), (0.82, 2.48, 92)]
    for k, (cx, cy, turn) in enumerate(seats):
        writer.place(f"chair-{k}", stored, "oak", _pose(cx, cy, turn))
        pad = cushion((0.40, 0.38, 0.06), 2 * preset.segments).turned(turn).at(cx, cy, 0.458)
        writer.mesh(f"chair-cushion-{k}", pad, "gingham-blue")
    top = 0.757
    writer.mesh("fruit-bowl", objects.vase("bowl", 3 * preset.segments).at(x, y, top), "glaze-blue")
    writer.mesh("fruit", objects.fruit(8, 0.042, 3, preset.segments).at(x, y, top), "orange")
    jug = objects.vase("jar", 2 * preset.segments, 0.8).at(x - 0.45, y + 0.12, top)
    writer.mesh("jug", jug, "glaze-cream")


def _pose(x: float, y: float, turn: float) -> Floats:
    """Return a (4, 4) matrix that turns about z and moves on the floor."""
    matrix = np.eye(4)
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    matrix[:2, :2] = [[c, -s], [s, c]]
    matrix[:2, 3] = x, y
    return matrix


def _lamps(writer: SceneWriter, preset: Preset) -> None:
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
    writer.light("#ffd9a0", 4.0)
    stand, cloth = objects.floor_lamp(preset.segments)
    writer.mesh("floor-lamp", stand.at(6.72, 1.25), "brass")
    writer.mesh("floor-lamp-shade", cloth.at(6.72, 1.25), "shade-cloth", crease_deg=80)
    writer.light("#ffcf8f", 1.1, share=0.6)


def _seating(writer: SceneWriter, preset: Preset) -> None:
    """Add the sofa with its cushions, the rug and the low table."""
    n = preset.segments
    writer.mesh("rug", _flat(2.9, 2.0).at(5.2, 3.15, 0.012), "rug")
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


def _library(writer: SceneWriter) -> None:
    """Add two bookcases on the north wall, filled with books."""
    size = (1.3, 0.3, 2.15)
    stored = writer.store("bookcase", box_mapped(furniture.bookcase(size, 6), 0.7, grain="z"))
    rows: dict[int, list[Mesh]] = {k: [] for k in range(len(BOOKS))}
    for case, x in enumerate((1.55, 2.92)):
        y = WIDTH - 0.16
        writer.place(f"bookcase-{case}", stored, "walnut", _pose(x, y, 0))
        for shelf, z in enumerate(furniture.shelf_heights(size[2], 6)):
            for half, start in enumerate((x - 0.61, x + 0.025)):
                seed = 100 * case + 10 * shelf + half
                row = furniture.books((start, y - 0.10, z + 0.012), 0.58, len(BOOKS), seed)
                for colour, volumes in enumerate(row):
                    rows[colour].append(volumes)
    for colour, shelved in rows.items():
        writer.mesh(f"books-{colour}", join(shelved), f"book-{colour}")


def _east_wall(writer: SceneWriter, preset: Preset) -> None:
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
    _picture(writer, "east-picture", "painting-discs", (0.85, 0.85), (LENGTH, 3.1, 1.82), EAST)
    for k, along in enumerate((2.16, 4.04)):
        _picture(writer, f"print-{k}", "painting-stem", (0.36, 0.5), (LENGTH, along, 1.85), EAST)


def _walls_dressed(writer: SceneWriter) -> None:
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
        _picture(writer, f"south-picture-{k}", art, size, (along, 0.0, 1.72), SOUTH)


def _plants(writer: SceneWriter, preset: Preset) -> None:
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
