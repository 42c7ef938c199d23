"""Contents of GALLERY: paintings, a mirror, showcases, pedestals with sculpture, a bench and a door."""

from __future__ import annotations

from studies.scenes import colonnade, joinery, objects
from studies.scenes.gallery_plan import WIDTH
from studies.scenes.joinery import GILT, NORTH, WEST
from studies.scenes.pieces import flat, hang_picture
from studies.scenes.presets import Preset
from studies.scenes.shading import box_mapped
from studies.scenes.solids import Mesh, Vector, block, join, lathe, span, sphere
from studies.scenes.sweeps import frame
from studies.scenes.writer import SceneWriter

CASE_FOOT, CASE_GLASS = 0.92, 0.78  # height of a showcase's base and of its glass
CASES = ((4.7, 4.5, 0.72), (8.05, 2.75, 0.85), (10.9, 3.75, 1.0))  # x, y, side
PEDESTALS = ((6.35, 4.85, 0.95), (9.2, 5.35, 1.05), (3.3, 2.2, 0.75))  # x, y, height


def add_paintings(writer: SceneWriter) -> None:
    """Hang paintings in gilded frames, and a mirror of the same kind, on the north and west walls."""
    y = WIDTH
    hang_picture(writer, "north-hills", "painting-hills", (1.7, 1.15), (3.0, y, 1.75), NORTH)
    hang_picture(writer, "north-discs", "painting-discs", (1.2, 1.2), (5.3, y, 1.75), NORTH)
    hang_picture(writer, "north-stem", "painting-stem", (0.62, 0.86), (9.0, y, 1.75), NORTH)
    hang_picture(writer, "north-hills-2", "painting-hills", (1.25, 0.85), (10.6, y, 1.75), NORTH)
    hang_picture(writer, "north-stem-2", "painting-stem", (0.62, 0.86), (12.1, y, 1.75), NORTH)
    hang_picture(writer, "west-discs", "painting-discs", (1.0, 1.0), (0.0, 5.2, 1.75), WEST)
    size = (1.15, 1.9)
    surround = frame(size[0] + 0.14, size[1] + 0.14, [(1.6 * out, 1.4 * z) for out, z in GILT])
    writer.mesh("mirror-frame", joinery.hung(surround, 7.2, y, 1.6, NORTH), "gilt")
    writer.mesh("mirror", joinery.hung(flat(*size).at(0, 0, 0.008), 7.2, y, 1.6, NORTH), "mirror")


def add_showcases(writer: SceneWriter, preset: Preset) -> None:
    """Stand glazed showcases in the hall, the last before the east window."""
    n = preset.segments
    bases, edges, panes, trays = [], [], [], []
    for x, y, side in CASES:
        case = _showcase(side)
        bases.append(case[0].at(x, y))
        edges.append(case[1].at(x, y))
        panes.append(case[2].at(x, y))
        trays.append(block((side - 0.08, side - 0.08, 0.02), 0.004).at(x, y, CASE_FOOT))
    writer.mesh("showcase-bases", box_mapped(join(bases), 0.8, grain="z"), "walnut")
    writer.mesh("showcase-edges", join(edges), "brass")
    writer.mesh("showcase-panes", join(panes), "glass-pane")
    writer.mesh("showcase-trays", join(trays), "linen")
    top = CASE_FOOT + 0.02
    exhibits: tuple[tuple[str, Mesh, str, Vector], ...] = (
        ("amphora", objects.vase("bottle", 3 * n, 1.5), "terracotta", (4.63, 4.58, top)),
        ("dish", objects.vase("bowl", 3 * n, 0.8), "glaze-blue", (4.84, 4.36, top)),
        ("urn", objects.vase("jar", 3 * n, 1.6), "glaze-blue", (7.95, 2.85, top)),
        ("goblet", colonnade.knot(0.16, 0.035, 6 * n, n), "brass", (8.27, 2.58, top + 0.17)),
        ("bottle", objects.vase("bottle", 3 * n, 1.7), "glaze-green", (10.72, 3.95, top)),
        ("jar", objects.vase("jar", 3 * n, 1.3), "terracotta", (11.12, 3.55, top)),
        ("cup", objects.vase("bowl", 3 * n, 0.7), "brass", (10.7, 3.5, top)),
    )
    for name, mesh, material, where in exhibits:
        writer.mesh(f"exhibit-{name}", mesh.at(*where), material)


def add_pedestals(writer: SceneWriter, preset: Preset) -> None:
    """Stand a polished knot, a ball of solid glass and a marble vessel on pedestals."""
    n = preset.segments
    stands = []
    for x, y, height in PEDESTALS:
        stands += [
            block((0.44, 0.44, 0.08), 0.012).at(x, y),
            block((0.36, 0.36, height - 0.12), 0.006).at(x, y, 0.08),
            block((0.42, 0.42, 0.04), 0.010).at(x, y, height - 0.04),
        ]
    writer.mesh("pedestals", join(stands), "stone")
    (x, y, z), (bx, by, bz), (ux, uy, uz) = PEDESTALS
    knot = colonnade.knot(0.27, 0.055, 10 * n, n).turned(40).at(x, y, z + 0.30)
    writer.mesh("knot", knot, "steel", crease_deg=70)
    writer.mesh("ball", sphere(0.17, 6 * n).at(bx, by, bz + 0.20), "glass")
    ring = lathe([(0.07, 0.0), (0.11, 0.0), (0.10, 0.035), (0.075, 0.035), (0.07, 0.0)], 3 * n)
    writer.mesh("ball-ring", ring.bare().at(bx, by, bz), "brass")
    writer.mesh("vessel", objects.vase("jar", 4 * n, 1.9).at(ux, uy, uz), "marble")


def add_furniture(writer: SceneWriter, preset: Preset) -> None:
    """Add a bench, a cord before the paintings and the door behind the camera."""
    seat = [block((2.0, 0.52, 0.07), 0.02).at(9.4, 3.95, 0.40)]
    seat += [span((x, y, 0.0), (x + 0.06, y + 0.06, 0.40), 0.006) for x in (8.55, 10.2) for y in (3.75, 4.08)]
    writer.mesh("bench", box_mapped(join(seat), 0.9, grain="x"), "walnut")
    posts = lathe(
        [
            (0.0, 0.0),
            (0.13, 0.0),
            (0.13, 0.012),
            (0.02, 0.03),
            (0.014, 0.05),
            (0.014, 0.86),
            (0.03, 0.89),
            (0.0, 0.92),
        ],
        2 * preset.segments,
    )
    writer.mesh("posts", join(posts.bare().at(x, 6.2) for x in (2.0, 3.9, 5.8)), "brass")
    door = joinery.hung(joinery.panelled_door(1.3, 2.6), 0.0, 2.6, 0.02, WEST)
    surround = joinery.hung(joinery.architrave(1.32, 2.62), 0.0, 2.6, 0.0, WEST)
    writer.mesh("door", box_mapped(join([door, surround]), 0.9, grain="z"), "walnut")


def _showcase(side: float) -> tuple[Mesh, Mesh, Mesh]:
    """Return a showcase's base, the metal of its edges, and its five panes, centred on the origin."""
    half, low, high = side / 2, CASE_FOOT, CASE_FOOT + CASE_GLASS
    base = join(
        [block((side - 0.1, side - 0.1, 0.08), 0.004), block((side, side, low - 0.08), 0.008).at(0, 0, 0.08)]
    )
    bar, pane = 0.006, half - 0.004
    edges = [
        span((a * half - bar, b * half - bar, low), (a * half + bar, b * half + bar, high), 0.001)
        for a in (-1, 1)
        for b in (-1, 1)
    ]
    for z in (low + bar, high):
        for s in (-1, 1):
            edges.append(span((-half, s * half - bar, z - bar), (half, s * half + bar, z + bar), 0.001))
            edges.append(span((s * half - bar, -half, z - bar), (s * half + bar, half, z + bar), 0.001))
    ring = [(-pane, -pane), (pane, -pane), (pane, pane), (-pane, pane)]
    panes = [
        colonnade.pane(((*a, low), (*b, low), (*b, high), (*a, high)))
        for a, b in zip(ring, [*ring[1:], ring[0]], strict=True)
    ]
    corners = [(x, y, high) for x, y in ring]
    panes.append(colonnade.pane((corners[0], corners[1], corners[2], corners[3])))
    return base, join(edges), join(panes)
