"""Keyframes and exact projections of analytic scenes, for the tests of geometry, warp and antialiasing."""

from __future__ import annotations

import numpy as np

from enfilade.camera.pinhole import Camera
from enfilade.gbuffer import find_geometry
from enfilade.records import Geometry, Halves, Keyframe, Shading
from enfilade.renderer import PixelFilter, Purpose, RandomKey
from support.analytic import AnalyticRenderer
from support.analytic_scene import AnalyticScene, Plane, Quad, Sphere


def geometry_of(scene: AnalyticScene, camera: Camera) -> Geometry:
    return find_geometry(AnalyticRenderer(scene), camera)


def traced_image(scene: AnalyticScene, camera: Camera, *, spp: int = 1, box: bool = False) -> Shading:
    """A whole image, of shape (H, W)."""
    pixels = np.arange(camera.width * camera.height, dtype=np.uint32)
    at = PixelFilter.BOX if box else PixelFilter.CENTRE
    got = AnalyticRenderer(scene).trace(
        camera, pixels, RandomKey(1, 0, Purpose.KEYFRAME), spp=spp, pixel_filter=at
    )
    size = (camera.height, camera.width)
    return Shading(got.color.reshape(*size, 3), got.variance.reshape(size), got.dropped)


def keyframe_of(scene: AnalyticScene, camera: Camera, *, spp: int = 1) -> Keyframe:
    """A keyframe through the pixels' centres, both halves the same."""
    color = traced_image(scene, camera, spp=spp).color
    return Keyframe(geometry_of(scene, camera), Halves(color, color))


def pixel_centres(camera: Camera) -> np.ndarray:
    """Image coordinates of every pixel, (H, W, 2) float64."""
    y, x = np.mgrid[: camera.height, : camera.width] + 0.5
    return np.stack([x, y], axis=-1)


def ray_directions(camera: Camera, at: np.ndarray | None = None) -> np.ndarray:
    """World directions of unit depth through image points (..., 2), float64."""
    at = pixel_centres(camera) if at is None else at
    f, (x, y) = camera.focal_px, camera.principal_point
    local = np.stack(
        [
            (at[..., 0] - x * camera.width) / f,
            -(at[..., 1] - y * camera.height) / f,
            -np.ones(at.shape[:-1]),
        ],
        axis=-1,
    )
    return local @ camera.world_from_camera[:3, :3].T


def first_hits(scene: AnalyticScene, eye: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance in lengths of the direction (infinite where missed) and shape of rays (..., 3), float64."""
    nearest = np.full(direction.shape[:-1], np.inf)
    shape_index = np.zeros(direction.shape[:-1], int)
    with np.errstate(divide="ignore", invalid="ignore"):
        for number, shape in enumerate(scene.shapes, 1):
            distance = _distance(shape, eye, direction)
            is_nearer = (distance > 1e-9) & (distance < nearest)
            nearest = np.where(is_nearer, distance, nearest)
            shape_index = np.where(is_nearer, number, shape_index)
    return nearest, shape_index


def _distance(shape: Plane | Quad | Sphere, eye: np.ndarray, d: np.ndarray) -> np.ndarray:
    match shape:
        case Plane():
            n = np.array(shape.normal, float)
            return (np.array(shape.point) - eye) @ n / (d @ n)
        case Quad():
            u, v = np.array(shape.edge_u, float), np.array(shape.edge_v, float)
            n = np.cross(u, v)
            t = (np.array(shape.corner) - eye) @ n / (d @ n)
            local = eye + t[..., None] * d - np.array(shape.corner)
            a, b = np.linalg.lstsq(np.stack([u, v], axis=1), local.reshape(-1, 3).T, rcond=None)[0]
            inside = ((a >= 0) & (a <= 1) & (b >= 0) & (b <= 1)).reshape(t.shape)
            return np.where(inside, t, np.inf)
        case Sphere():
            offset = eye - np.array(shape.centre)
            a, b, c = (d * d).sum(-1), (d * offset).sum(-1), (offset * offset).sum(-1) - shape.radius**2
            root = np.sqrt(b * b - a * c)
            near, far = (-b - root) / a, (-b + root) / a
            return np.nan_to_num(np.where(near > 1e-9, near, far), nan=np.inf)


def projected(camera: Camera, world: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Image coordinates (..., 2) and depth of world points, float64."""
    local = (world - camera.eye) @ camera.world_from_camera[:3, :3]
    depth = -local[..., 2]
    f, (centre_x, centre_y) = camera.focal_px, camera.principal_point
    x = centre_x * camera.width + f * local[..., 0] / depth
    y = centre_y * camera.height - f * local[..., 1] / depth
    return np.stack([x, y], axis=-1), depth


def psnr(image: np.ndarray, reference: np.ndarray) -> float:
    """Peak signal-to-noise ratio of images in 0..1, dB."""
    return float(-10 * np.log10(np.mean((image.astype(float) - reference) ** 2) + 1e-20))
