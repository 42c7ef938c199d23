"""Injected errors change what they name, and nothing else."""

import numpy as np

from enfilade.gbuffer import find_geometry
from studies.bench.injected import blurred, brightened
from support.analytic import AnalyticRenderer
from support.example_scenes import room, room_walk


def test_one_object_is_brighter():
    image = np.full((2, 3, 3), 0.5, np.float32)
    index = np.array([[1, 2, 2], [1, 1, 2]], np.uint32)
    found = brightened(image, index, 2)
    np.testing.assert_allclose(found[index == 2], 0.515, rtol=1e-6)
    assert (found[index == 1] == 0.5).all()


def test_irradiance_is_blurred_within_shapes_and_textures_stay():
    geometry = find_geometry(AnalyticRenderer(room()), room_walk(1).cameras[0])
    lit = np.repeat(geometry.albedo[..., :1] * 0 + 0.4, 3, axis=2)
    even = (lit * geometry.albedo).astype(np.float32)
    found = blurred(even, geometry, lambda a: a)
    is_diffuse = geometry.has_diffuse & (geometry.albedo.min(axis=2) > 1e-3)
    np.testing.assert_allclose(found[is_diffuse], even[is_diffuse], atol=1e-4)  # even light is not changed
    assert (found[~geometry.has_diffuse] == even[~geometry.has_diffuse]).all()
    # A shadow edge within one shape becomes softer; light is kept on the whole.
    shadow = np.where(np.arange(even.shape[1])[None, :, None] < even.shape[1] // 2, 0.2, 1.0).astype(
        np.float32
    )
    cast = even * shadow
    soft = blurred(cast, geometry, lambda a: a)
    middle = even.shape[1] // 2
    is_same = is_diffuse[:, middle - 1] & is_diffuse[:, middle]
    is_same &= geometry.shape_index[:, middle - 1] == geometry.shape_index[:, middle]
    light = [image / np.maximum(geometry.albedo, 1e-3) for image in (cast, soft)]
    before, after = (np.abs(i[:, middle] - i[:, middle - 1])[is_same].mean() for i in light)
    assert after < 0.4 * before
    assert abs(soft[is_diffuse].mean() / cast[is_diffuse].mean() - 1.0) < 0.02
