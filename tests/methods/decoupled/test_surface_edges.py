"""Edges between surfaces, and thin surfaces, against loops and on shapes whose edges are known."""

import numpy as np
import pytest

from enfilade.gbuffer import find_geometry
from enfilade.methods.decoupled import surface_edges as kernel
from enfilade.methods.decoupled.surface_image import PLANE_TOLERANCE
from support.material_scene import MATERIALS, front_camera, opened_scene
from twins import surface_edges as twin


def block(angle: float, width: float) -> str:
    """A shape in place of a ball: a block that is turned about its vertical axis."""
    return (
        '</shape><shape type="cube" id="block"><transform name="to_world">'
        f'<scale x="{width}" y="0.5" z="0.5"/><rotate y="1" angle="{angle}"/><translate y="1.5" z="1.5"/>'
        '</transform><bsdf type="plastic"/>'
    )


def test_the_kernel_finds_the_edges_of_the_loops(tmp_path):
    balls = dict.fromkeys("abcdefghijklm", MATERIALS["diffuse"])
    geometry = find_geometry(opened_scene(tmp_path, balls), front_camera(64, 48))
    found = kernel.surface_edges(geometry)
    expected = twin.surface_edges(
        geometry,
        crease_cosine=kernel.CREASE_COSINE,
        plane_tolerance=PLANE_TOLERANCE,
        reach=kernel.RADIUS_PX,
        min_support=kernel.MIN_SUPPORT,
    )
    for ours, theirs in zip(found, expected, strict=True):
        assert 0.02 < theirs.mean() < 0.9
        # Single precision decides otherwise where a distance is just at the tolerance.
        assert (ours != theirs).mean() < 2e-3


def test_surfaces_go_on_to_the_sides_where_the_next_pixel_is_no_edge(tmp_path):
    renderer = opened_scene(tmp_path, {"ball": block(0.0, 0.5)})
    geometry = find_geometry(renderer, front_camera(96, 72))
    low, high = kernel.own_sides(geometry)
    is_edge, _ = kernel.surface_edges(geometry)
    inside = np.s_[1:-1, 1:-1]
    ends = (low == 0.0).any(axis=2) | (high == 0.0).any(axis=2)
    np.testing.assert_array_equal(ends[inside], is_edge[inside])
    # The front of the block, row by row: it ends to the left at its first pixel, to the right at its last.
    front = geometry.shape_index == renderer.describe().shapes.index("block") + 1
    row = int(np.argmax(front.sum(axis=1)))
    first, *_, last = np.flatnonzero(front[row])
    for side, expected in ((low, [0.0, -1.0]), (high, [1.0, 0.0])):
        assert [side[row, column, 0] for column in (first, last)] == expected
    column = (first + last) // 2
    top, *_, bottom = np.flatnonzero(front[:, column])
    assert (low[top, column, 1], high[bottom, column, 1]) == (0.0, 0.0)


def test_a_crease_within_a_shape_is_an_edge(tmp_path):
    renderer, camera = opened_scene(tmp_path, {"ball": block(45.0, 0.5)}), front_camera(96, 72)
    geometry = find_geometry(renderer, camera)
    where = geometry.shape_index == renderer.describe().shapes.index("block") + 1
    is_edge, _ = kernel.surface_edges(geometry)
    rows = where.sum(axis=1) > 12
    inside = where & rows[:, None]
    inside[:, 1:] &= where[:, :-1]
    inside[:, :-1] &= where[:, 1:]
    # In the middle of every row the two front faces meet: two pixels.
    crease = (is_edge & inside).sum(axis=1)[rows]
    assert rows.sum() > 8
    assert np.median(crease) == 2


def test_a_post_narrower_than_three_pixels_is_thin(tmp_path):
    camera = front_camera(96, 72)
    shares = []
    for width in (0.04, 0.5):
        renderer = opened_scene(tmp_path, {"ball": block(0.0, width)})
        geometry = find_geometry(renderer, camera)
        where = geometry.shape_index == renderer.describe().shapes.index("block") + 1
        assert where.any()
        shares.append(kernel.surface_edges(geometry)[1][where].mean())
    assert shares[0] == 1.0
    assert shares[1] < 0.1


def edges_of(surface):
    """Pixels with one of their four neighbours on another surface."""
    is_edge = np.zeros(surface.shape, bool)
    for axis in (0, 1):
        step = np.diff(surface, axis=axis) != 0
        is_edge |= np.pad(step, [(1, 0), (0, 0)][:: 1 - 2 * axis])
        is_edge |= np.pad(step, [(0, 1), (0, 0)][:: 1 - 2 * axis])
    return is_edge


def test_bars_are_narrow_and_squares_are_not():
    surface = np.zeros((50, 60), int)
    surface[5:25, 5:25] = 1  # a square
    surface[5:45, 32:38] = 2  # a bar of six pixels
    surface[5:45, 45:53] = 3  # a bar of eight pixels
    found = kernel.narrow_surfaces(edges_of(surface), surface > 0)
    assert found[surface == 2].all()
    assert not found[surface == 1].any()
    assert not found[surface == 3].any()
    assert not found[surface == 0].any()


@pytest.mark.parametrize("width", [1, 2, 3, 6])
@pytest.mark.parametrize("slope", [0.0, 0.3, 1.0])
def test_bars_before_a_wide_wall_are_narrow(width, slope):
    row, column = np.indices((60, 80))
    offset = np.floor(column - slope * row) - 20
    is_bar = (offset >= 0) & (offset < width)
    found = kernel.narrow_surfaces(edges_of(is_bar.astype(int)), np.ones_like(is_bar))
    inside = (slice(8, 52), slice(8, 72))
    assert found[inside][is_bar[inside]].all()
    assert not found[inside][~is_bar[inside]].any()
