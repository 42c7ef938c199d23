"""ATRIUM's shell: floors, walls, roof, columns, stair and railings."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely

from studies.scenes import colonnade, joinery, pictures
from studies.scenes.atrium_plan import (
    BAYS_X,
    COLUMNS_X,
    EAST_EDGE,
    GALLERY,
    HEIGHT,
    LENGTH,
    NORTH_EDGE,
    RISE,
    RUN,
    SLAB,
    SOUTH_EDGE,
    STAIR_HIGH,
    STAIR_LOW,
    STAIR_START,
    STEPS,
    WIDTH,
)
from studies.scenes.joinery import EAST, NORTH, SOUTH, WEST
from studies.scenes.presets import Preset
from studies.scenes.shading import box_mapped
from studies.scenes.solids import Floats, Mesh, arch, extrude_parts, join, span, surface
from studies.scenes.sweeps import moulding
from studies.scenes.writer import SceneWriter


def _sheet(x0: float, y0: float, x1: float, y1: float, tile: tuple[float, float]) -> Mesh:
    """Return a level rectangle, face up, with texture repeats of `tile` metres."""

    def flat(u: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        return x0 + (x1 - x0) * u, y0 + (y1 - y0) * v, 0.0 * u

    mesh = surface(flat, 1, 1)
    return Mesh(mesh.positions, mesh.faces, mesh.positions[:, :2] / np.array(tile))


def add_floors(writer: SceneWriter) -> None:
    """Lay the polished floor and the galleries with their moulded edges."""
    floor = _sheet(0, 0, LENGTH, WIDTH, (3.8, 2.8))
    writer.mesh("floor", floor.tiled(1.0, 1.0, (1.0 - 3.2 / 3.8, 0.0)), "floor")
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


def add_walls(writer: SceneWriter, preset: Preset) -> None:
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
        for part, low, high in (("lower", 0.0, GALLERY - SLAB), ("upper", GALLERY - SLAB, HEIGHT + 0.5)):
            plate = joinery.wall(shapely.box(0, low, length, high), openings, 0.35)
            plate = box_mapped(plate, (2.4, 2.0)).turned(turn).at(x, y)
            writer.mesh(f"wall-{name}-{part}", plate, "stucco" if part == "lower" else "ashlar")
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


def add_roof(writer: SceneWriter, preset: Preset) -> None:
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
    size = EAST_EDGE, NORTH_EDGE - SOUTH_EDGE
    sky = _sheet(0, 0, *size, size).flipped()
    writer.mesh("roof-sky", sky.at(0, SOUTH_EDGE, HEIGHT + 0.26), "glow")
    writer.light(writer.radiance("clouds", pictures.overcast(preset.texture // 4, 3.6)), weight=4.0)
    north = _sheet(0, 0, LENGTH, 3.4, (LENGTH, 3.4)).turned(90, "x")
    east = _sheet(0, 0, 9.0, 3.6, (9.0, 3.6)).turned(90, "x").turned(EAST)
    panels = [
        north.at(0, WIDTH + 0.4, 4.7),
        north.turned(180).at(LENGTH, -0.4, 4.7),
        east.at(LENGTH + 0.4, 11.5, 4.6),
    ]
    writer.mesh("window-sky", join(panels), "glow")
    writer.light("#d3e5f8", 1.15)


def add_columns(writer: SceneWriter, preset: Preset) -> None:
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


def add_stair(writer: SceneWriter, preset: Preset) -> None:
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


def add_railings(writer: SceneWriter, preset: Preset) -> None:
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
