"""Contents of ATRIUM: mirrors, lamps, doors, the sculpture and the trees."""

from __future__ import annotations

from studies.scenes import colonnade, joinery, objects
from studies.scenes.atrium_plan import BAYS_X, EAST_EDGE, GALLERY, LENGTH, SLAB, WIDTH
from studies.scenes.joinery import EAST, NORTH, SOUTH, WEST
from studies.scenes.presets import Preset
from studies.scenes.shading import box_mapped
from studies.scenes.solids import arch, block, extrude, join, lathe, span
from studies.scenes.writer import SceneWriter


def add_mirrors(writer: SceneWriter, preset: Preset) -> None:
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


def add_lamps(writer: SceneWriter, preset: Preset) -> None:
    """Set round warm lamps into the underside of the galleries."""
    disc = lathe([(0.0, 0.0), (0.34, 0.0)], 2 * preset.segments)
    rim = lathe([(0.34, 0.0), (0.34, -0.03), (0.38, -0.04), (0.42, -0.03), (0.42, 0.0)], 2 * preset.segments)
    z = GALLERY - SLAB - 0.012
    spots = [(x, y) for x in BAYS_X for y in (1.4, WIDTH - 1.4)] + [(20.2, 4.0), (20.2, 10.0)]
    writer.mesh("lamps", join(disc.bare().at(x, y, z) for x, y in spots), "glow")
    writer.light("#ffdcae", 7.0, weight=2.0)
    writer.mesh("lamp-rims", join(rim.bare().at(x, y, z) for x, y in spots), "brass")


def add_doors(writer: SceneWriter) -> None:
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


def add_sculpture(writer: SceneWriter, preset: Preset) -> None:
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


def add_planting(writer: SceneWriter, preset: Preset) -> None:
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
        wood.append(trunk.bare().turned(70 * k).at(x, y, 0.58))
        leaves.append(crown.bare().turned(70 * k).at(x, y, 0.58))
    writer.mesh("tubs", join(tub.bare().at(x, y) for x, y in spots), "planter")
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
