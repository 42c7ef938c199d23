"""ATRIUM: a hall of two storeys with polished floor, mirrors, glass and metal (§6).

A steady walk past columns towards the stair. x runs east along the hall, y north.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely

from enfilade.scenes import colonnade, joinery, objects, pictures, textures
from enfilade.scenes.joinery import EAST, NORTH, SOUTH, WEST
from enfilade.scenes.materials import Material
from enfilade.scenes.presets import Preset
from enfilade.scenes.shading import box_mapped
from enfilade.scenes.solids import (
    Floats,
    Mesh,
    arch,
    block,
    extrude,
    extrude_parts,
    join,
    lathe,
    span,
    surface,
)
from enfilade.scenes.sweeps import moulding
from enfilade.scenes.walk import Walk
from enfilade.scenes.writer import SceneWriter

LENGTH, WIDTH, HEIGHT = 22.0, 14.0, 8.5
GALLERY, SLAB = 4.08, 0.40  # height of the upper floor, and its thickness
SOUTH_EDGE, NORTH_EDGE, EAST_EDGE = 2.8, 11.2, 18.4
COLUMNS_X = (3.2, 7.0, 10.8, 14.6, 18.4)
BAYS_X = (1.3, 5.1, 8.9, 12.7, 16.5, 20.2)
STAIR_LOW, STAIR_HIGH, STEPS, RUN = 5.3, 8.7, 24, 0.28
STAIR_START = EAST_EDGE - STEPS * RUN
RISE = GALLERY / STEPS

FINISHES = {
    "plaster": Material("matte", "#efe9dc"),
    "stone-trim": Material("matte", "#e2d8c4"),
    "carpet": Material("matte", "#8e2f33"),
    "leaf": Material("matte", "#4d7a3c"),
    "bark": Material("matte", "#6a5240"),
    "earth": Material("matte", "#43352a"),
    "cushion": Material("matte", "#2f5f6b"),
    "glow": Material("matte", "#ffffff"),
    "steel": Material("metal", "#c9ccd0", 0.12),
    "bronze": Material("metal", "#b98d5a", 0.18),
    "brass": Material("metal", "#e0b865", 0.10),
    "mirror": Material("mirror", "#e9ecec"),
    "glass": Material("pane", "#eef6f3"),
    "planter": Material("matte", "#4a5257"),
    "plinth": Material("polished", "#3c3b3d"),
}


def furnish(writer: SceneWriter, preset: Preset) -> None:
    """Build the whole hall."""
    _materials(writer, preset)
    _floors(writer)
    _walls(writer, preset)
    _roof(writer, preset)
    _columns(writer, preset)
    _stair(writer, preset)
    _railings(writer, preset)
    _mirrors(writer, preset)
    _lights(writer, preset)
    _doors(writer)
    _sculpture(writer, preset)
    _planting(writer, preset)


def walk(preset: Preset) -> tuple[Walk, int]:
    """Return the camera's walk and its number of frames."""
    stations = [
        ((4.3, 13.0, 1.60), (13.0, 11.1, 2.25)),
        ((4.9, 11.2, 1.65), (14.0, 8.7, 2.5)),
        ((5.5, 8.8, 1.85), (15.0, 5.9, 2.85)),
        ((6.3, 6.2, 2.25), (15.8, 3.1, 3.15)),
        ((7.4, 4.0, 2.60), (16.4, 1.0, 3.25)),
    ]
    return Walk(stations, [(0.0, 1.0), (1.0, 1.0)], fov_deg=54.0), 60 if preset.is_small else 200


def _materials(writer: SceneWriter, preset: Preset) -> None:
    """Declare every finish of the hall."""
    big, mid = preset.texture, preset.texture // 2
    for name, material in FINISHES.items():
        writer.material(name, material)
    paving = textures.paving(big, ("#e3d8c4", "#47413c", "#b98a60"), 4)
    writer.material("floor", Material("polished", writer.texture("paving", paving)))
    green = writer.texture("green-marble", textures.veined(mid, "#2f4f46", "#c9d6c4", 8))
    writer.material("green-marble", Material("satin", green, 0.06))
    wall = writer.texture("ashlar", textures.ashlar(mid, "#dccfb6", "#a6977e", 4, 6))
    writer.material("ashlar", Material("matte", wall))
    steps = writer.texture("travertine", textures.veined(mid, "#e6dcc8", "#b8a88c", 15))
    writer.material("travertine", Material("matte", steps))
    oak = writer.texture("oak", textures.wood(mid, "#6b4529", "#a97b4e", 3))
    writer.material("oak", Material("matte", oak))
    writer.material("varnish", Material("satin", oak, 0.12))


def _sheet(x0: float, y0: float, x1: float, y1: float, tile: tuple[float, float]) -> Mesh:
    """Return a level rectangle, face up, with texture repeats of `tile` metres."""

    def flat(u: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        return x0 + (x1 - x0) * u, y0 + (y1 - y0) * v, 0.0 * u

    mesh = surface(flat, 1, 1)
    return Mesh(mesh.positions, mesh.faces, mesh.positions[:, :2] / np.array(tile))


def _floors(writer: SceneWriter) -> None:
    """Lay the polished floor and the galleries with their moulded edges."""
    floor = _sheet(0, 0, LENGTH, WIDTH, (3.8, 2.8))
    assert floor.uvs is not None  # noqa: S101 - just made
    uvs = floor.uvs + np.array([1.0 - 3.2 / 3.8, 0.0])
    writer.mesh("floor", Mesh(floor.positions, floor.faces, uvs), "floor")
    well = shapely.box(-1.0, SOUTH_EDGE, EAST_EDGE, NORTH_EDGE)
    slab = extrude_parts(shapely.box(0, 0, LENGTH, WIDTH) - well, SLAB)
    writer.mesh("galleries", slab.at(0, 0, GALLERY - SLAB), "plaster")
    edge = [(0.0, NORTH_EDGE), (EAST_EDGE, NORTH_EDGE), (EAST_EDGE, SOUTH_EDGE), (0.0, SOUTH_EDGE)]
    fascia = [
        (0.0, -SLAB),
        (-0.03, -SLAB + 0.01),
        (-0.03, -0.26),
        (-0.05, -0.25),
        (-0.05, -0.10),
        (-0.09, -0.06),
        (-0.12, -0.05),
        (-0.12, 0.0),
        (-0.10, 0.012),
        (0.1, 0.012),
    ]
    writer.mesh("gallery-edge", moulding(fascia, edge).at(0, 0, GALLERY), "stone-trim")
    beams = [
        span((x - 0.18, y0, GALLERY - SLAB - 0.18), (x + 0.18, y1, GALLERY - SLAB + 0.02), 0.02)
        for x in COLUMNS_X
        for y0, y1 in ((0.0, SOUTH_EDGE), (NORTH_EDGE, WIDTH))
    ]
    writer.mesh("gallery-beams", join(beams), "plaster")


def _walls(writer: SceneWriter, preset: Preset) -> None:
    """Raise the walls, with arched windows upstairs, pilasters and string courses."""
    n = preset.segments
    holes = [shapely.Polygon([(x + px, 5.0 + py) for px, py in arch(1.5, 2.7, 0.75, n)]) for x in BAYS_X]
    mirrored = [shapely.transform(h, lambda p: np.array([LENGTH, 0.0]) + p * [-1, 1]) for h in holes]
    east = [
        shapely.Polygon([(y + px, 4.9 + py) for px, py in arch(1.9, 3.0, 0.95, n)]) for y in (4.3, 7.0, 9.7)
    ]
    portal = [shapely.Polygon([(7.0 + px, py - 0.1) for px, py in arch(3.0, 3.6, 1.5, n)])]
    sides = {
        "north": (LENGTH, NORTH, 0.0, WIDTH, holes),
        "south": (LENGTH, SOUTH, LENGTH, 0.0, mirrored),
        "east": (WIDTH, EAST, LENGTH, WIDTH, east),
        "west": (WIDTH, WEST, 0.0, 0.0, portal),
    }
    for name, (length, turn, x, y, openings) in sides.items():
        plate = joinery.wall(shapely.box(0, 0, length, HEIGHT + 0.5), openings, 0.35)
        plate = box_mapped(plate, (2.4, 2.0)).turned(turn).at(x, y)
        writer.mesh(f"wall-{name}", plate, "ashlar")
    ends = ((0.0, 0.0), (LENGTH, WIDTH))
    trims = [
        joinery.ring([(2 * a, 2 * b) for a, b in joinery.SKIRTING], *ends, 0.0),
        joinery.ring(joinery.CORNICE, *ends, GALLERY - SLAB),
        joinery.ring([(1.6 * a, 1.6 * b) for a, b in joinery.CORNICE], *ends, HEIGHT),
    ]
    pilasters = [
        span((x - 0.22, y0, z0), (x + 0.22, y1, z1), 0.02)
        for x in COLUMNS_X
        for y0, y1 in ((-0.02, 0.11), (WIDTH - 0.11, WIDTH + 0.02))
        for z0, z1 in ((0.0, GALLERY - SLAB), (GALLERY, HEIGHT))
    ]
    writer.mesh("wall-trim", join([*trims, *pilasters]), "stone-trim")
    frames = [
        joinery.hung(colonnade.arched_frame(1.5, 2.7, 0.13, 0.06, n), x, WIDTH, 5.0, NORTH) for x in BAYS_X
    ]
    frames += [
        joinery.hung(colonnade.arched_frame(1.5, 2.7, 0.13, 0.06, n), x, 0, 5.0, SOUTH) for x in BAYS_X
    ]
    frames += [
        joinery.hung(colonnade.arched_frame(1.9, 3.0, 0.15, 0.06, n), LENGTH, y, 4.9, EAST)
        for y in (4.3, 7.0, 9.7)
    ]
    writer.mesh("window-surrounds", join(frames), "stone-trim")


def _roof(writer: SceneWriter, preset: Preset) -> None:
    """Cover the galleries, and the hall with coffers open to the sky."""
    well = shapely.box(0.0, SOUTH_EDGE, EAST_EDGE, NORTH_EDGE)
    roof = extrude_parts(shapely.box(0, 0, LENGTH, WIDTH) - well, 0.2)
    writer.mesh("roof", roof.at(0, 0, HEIGHT + 0.02), "plaster")
    grid = colonnade.coffers((0.0, SOUTH_EDGE), (EAST_EDGE, NORTH_EDGE), HEIGHT - 0.12, (10, 4))
    writer.mesh("coffers", grid, "plaster")
    beams = [
        span((0.0, y - 0.24, HEIGHT - 0.62), (EAST_EDGE + 0.24, y + 0.24, HEIGHT + 0.1), 0.03)
        for y in (SOUTH_EDGE, NORTH_EDGE)
    ]
    beams += [
        span((0.0, y - 0.30, HEIGHT - 0.26), (EAST_EDGE + 0.3, y + 0.30, HEIGHT - 0.16), 0.03)
        for y in (SOUTH_EDGE, NORTH_EDGE)
    ]
    beams.append(
        span(
            (EAST_EDGE - 0.24, SOUTH_EDGE, HEIGHT - 0.62), (EAST_EDGE + 0.24, NORTH_EDGE, HEIGHT + 0.1), 0.03
        )
    )
    writer.mesh("entablature", join(beams), "stone-trim")
    sky = _sheet(0, SOUTH_EDGE, EAST_EDGE, NORTH_EDGE, (EAST_EDGE, 8.4)).flipped()
    writer.mesh("roof-sky", sky.at(0, 0, HEIGHT + 0.7), "glow")
    writer.light(writer.radiance("clouds", pictures.overcast(preset.texture // 4, 4.4)), share=3.0)
    north = _sheet(0, 0, LENGTH, 3.4, (LENGTH, 3.4)).turned(90, "x")
    east = _sheet(0, 0, 9.0, 3.6, (9.0, 3.6)).turned(90, "x").turned(EAST)
    panels = [
        north.at(0, WIDTH + 0.4, 4.7),
        north.turned(180).at(LENGTH, -0.4, 4.7),
        east.at(LENGTH + 0.4, 11.5, 4.6),
    ]
    writer.mesh("window-sky", join(panels), "glow")
    writer.light("#d3e5f8", 1.15)


def _columns(writer: SceneWriter, preset: Preset) -> None:
    """Stand the columns of both storeys."""
    n = preset.segments
    lower, lower_trim = colonnade.column(GALLERY - SLAB - 0.02, 0.27, n)
    upper, upper_trim = colonnade.column(HEIGHT - 0.62 - GALLERY, 0.20, n)
    stored = {
        "shaft-low": (writer.store("shaft-low", lower), "green-marble", 0.0),
        "trim-low": (writer.store("trim-low", lower_trim), "bronze", 0.0),
        "shaft-high": (writer.store("shaft-high", upper), "stone-trim", GALLERY),
        "trim-high": (writer.store("trim-high", upper_trim), "stone-trim", GALLERY),
    }
    spots = [(x, y) for x in COLUMNS_X for y in (SOUTH_EDGE + 0.05, NORTH_EDGE - 0.05)]
    for k, (x, y) in enumerate(spots):
        for part, (file, material, z) in stored.items():
            matrix = np.eye(4)
            matrix[:3, 3] = x, y, z
            writer.place(f"column-{part}-{k}", file, material, matrix)


def _stair(writer: SceneWriter, preset: Preset) -> None:
    """Build the great stair with its carpet and glass sides."""
    flight = colonnade.stair(STAIR_START, STAIR_LOW, STAIR_HIGH, RUN, RISE, STEPS)
    writer.mesh("stair", box_mapped(flight, 1.6), "travertine")
    cheeks = [
        colonnade.stringer(STAIR_START, y, RUN, RISE, STEPS) for y in (STAIR_LOW - 0.06, STAIR_HIGH + 0.06)
    ]
    writer.mesh("stringers", box_mapped(join(cheeks), 1.6), "travertine")
    carpet = colonnade.runner(STAIR_START, 7.0, 1.7, RUN, RISE, STEPS)
    writer.mesh("stair-carpet", carpet, "carpet", crease_deg=20)
    panes, metal = [], []
    for y in (STAIR_LOW - 0.06, STAIR_HIGH + 0.06):
        start = (STAIR_START + 0.05, y, 0.22)
        glass, rail = colonnade.balustrade(
            start, (EAST_EDGE - 0.06, y, GALLERY + 0.02), 6, preset.segments // 2
        )
        panes.append(glass)
        metal.append(rail)
    writer.mesh("stair-glass", join(panes), "glass")
    writer.mesh("stair-rails", join(metal), "brass")


def _railings(writer: SceneWriter, preset: Preset) -> None:
    """Guard the galleries with glass and brass."""
    z, n = GALLERY + 0.012, preset.segments // 2
    runs = []
    xs = (0.1, *COLUMNS_X)
    for y in (SOUTH_EDGE + 0.05, NORTH_EDGE - 0.05):
        for x0, x1 in pairwise(xs):
            runs.append(((x0 + (0.32 if x0 > 1 else 0), y, z), (x1 - 0.32, y, z), 3))
    for y0, y1 in ((SOUTH_EDGE + 0.35, STAIR_LOW - 0.06), (STAIR_HIGH + 0.06, NORTH_EDGE - 0.35)):
        runs.append(((EAST_EDGE - 0.05, y0, z), (EAST_EDGE - 0.05, y1, z), 2))
    parts = [colonnade.balustrade(a, b, bays, n) for a, b, bays in runs]
    writer.mesh("gallery-glass", join(p[0] for p in parts), "glass")
    writer.mesh("gallery-rails", join(p[1] for p in parts), "brass")


def _mirrors(writer: SceneWriter, preset: Preset) -> None:
    """Hang arched mirrors between the pilasters of the ground floor."""
    n = preset.segments
    outline = arch(1.7, 2.6, 0.85, n)
    mirror = extrude(outline, 0.01)
    surround = colonnade.arched_frame(1.7, 2.6, 0.10, 0.05, n)
    glass, frames = [], []
    for x in BAYS_X:
        for y, turn in ((WIDTH, NORTH), (0.0, SOUTH)):
            glass.append(joinery.hung(mirror, x, y, 0.42, turn))
            frames.append(joinery.hung(surround, x, y, 0.42, turn))
    writer.mesh("mirrors", join(glass), "mirror")
    writer.mesh("mirror-frames", join(frames), "bronze")


def _lights(writer: SceneWriter, preset: Preset) -> None:
    """Set round warm lamps into the underside of the galleries."""
    disc = lathe([(0.0, 0.0), (0.34, 0.0)], 2 * preset.segments)
    rim = lathe([(0.34, 0.0), (0.34, -0.03), (0.38, -0.04), (0.42, -0.03), (0.42, 0.0)], 2 * preset.segments)
    z = GALLERY - SLAB - 0.012
    spots = [(x, y) for x in BAYS_X for y in (1.4, WIDTH - 1.4)] + [(20.2, 4.0), (20.2, 10.0)]
    writer.mesh("lamps", join(colonnade.bare(disc).at(x, y, z) for x, y in spots), "glow")
    writer.light("#ffdcae", 7.0, share=2.0)
    writer.mesh("lamp-rims", join(colonnade.bare(rim).at(x, y, z) for x, y in spots), "brass")


def _doors(writer: SceneWriter) -> None:
    """Fit glazed doors beside the stair, and a portal with a door behind the camera."""
    bars, panes = [], []
    for y in (4.05, 9.95):
        for k in (-1, 1):
            leaf = joinery.casement(1.0, 2.6, 2, 4).turned(EAST)
            bars.append(leaf.at(EAST_EDGE + 0.1, y + 0.52 * k))
            x = EAST_EDGE + 0.13
            y0, y1 = y + 0.52 * k - 0.46, y + 0.52 * k + 0.46
            panes.append(colonnade.pane(((x, y0, 0.05), (x, y1, 0.05), (x, y1, 2.55), (x, y0, 2.55))))
    writer.mesh("glass-doors", join(panes), "glass")
    writer.mesh("glass-door-frames", join(bars), "bronze")
    doors = [joinery.hung(joinery.panelled_door(1.1, 2.5), LENGTH, y, 0.02, EAST) for y in (4.0, 10.0)]
    doors += [
        joinery.hung(joinery.panelled_door(1.48, 3.5), -0.1, 7.0 + s * 0.76, 0.0, WEST) for s in (-1, 1)
    ]
    writer.mesh("doors", box_mapped(join(doors), 0.9), "varnish")


def _sculpture(writer: SceneWriter, preset: Preset) -> None:
    """Set a brass knot on a plinth in the middle of the hall."""
    n = preset.segments
    plinth = [
        span((8.75, 6.65, 0.0), (9.85, 7.75, 0.12), 0.02),
        span((8.9, 6.8, 0.12), (9.7, 7.6, 0.95), 0.02),
        span((8.85, 6.75, 0.95), (9.75, 7.65, 1.02), 0.02),
    ]
    writer.mesh("plinth", join(plinth), "plinth")
    knot = colonnade.knot(0.62, 0.13, 8 * n, n).turned(35).at(9.3, 7.2, 1.74)
    writer.mesh("knot", knot, "brass", crease_deg=70)


def _planting(writer: SceneWriter, preset: Preset) -> None:
    """Plant trees in tubs, and put benches beside them."""
    n = preset.segments
    tub = lathe(
        [
            (0.0, 0.0),
            (0.30, 0.0),
            (0.33, 0.03),
            (0.42, 0.55),
            (0.46, 0.58),
            (0.46, 0.64),
            (0.41, 0.65),
            (0.40, 0.60),
            (0.0, 0.60),
        ],
        3 * n,
    )
    spots = ((8.9, 10.1), (12.7, 10.0), (12.7, 3.7), (16.9, 10.2), (16.9, 3.6))
    wood, leaves = [], []
    for k, (x, y) in enumerate(spots):
        trunk, crown = objects.tree(3.0 + 0.25 * (k % 3), 7 + k, 9 if preset.is_small else 16, 8)
        wood.append(colonnade.bare(trunk).turned(70 * k).at(x, y, 0.58))
        leaves.append(colonnade.bare(crown).turned(70 * k).at(x, y, 0.58))
    writer.mesh("tubs", join(colonnade.bare(tub).at(x, y) for x, y in spots), "planter")
    writer.mesh("tree-wood", join(wood), "bark")
    writer.mesh("tree-leaves", join(leaves), "leaf", crease_deg=60)
    benches = [block((1.7, 0.5, 0.07), 0.015).at(x, y, 0.40) for x, y in ((10.8, 10.3), (8.9, 3.3))]
    writer.mesh("benches", box_mapped(join(benches), 0.8), "varnish")
    legs = [
        block((0.06, 0.44, 0.4), 0.008).at(x + s * 0.65, y)
        for x, y in ((10.8, 10.3), (8.9, 3.3))
        for s in (-1, 1)
    ]
    writer.mesh("bench-legs", join(legs), "steel")
