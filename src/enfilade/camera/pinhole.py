"""Pinhole cameras: intrinsics, poses, and the matrices of McMillan's warp.

Axes are OpenGL's: in the camera's own frame +x is right, +y is up, and it looks along -z. Pixel
coordinates have x to the right and y down; pixel (0, 0) spans [0, 1] x [0, 1], its centre is (0.5, 0.5).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from enfilade.errors import CameraPathError

Matrix = npt.NDArray[np.float64]
LAST_ROW, ROW_TOLERANCE = (0.0, 0.0, 0.0, 1.0), 1e-5  # of a pose
CENTRE = (0.5, 0.5)  # principal point of a camera without lens shift
RIGID_TOLERANCE = 1e-3  # largest entry of |R^T R - 1|; exporters write 5 to 8 digits


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera.

    Attributes
    ----------
    world_from_camera : (4, 4) float64
        Rigid: a rotation and the eye's position; no scale, shear or reflection.
    fov_deg : float
        Vertical field of view, degrees, in (0, 180).
    width, height : int
        Pixels. Pixels are square.
    principal_point : tuple of float
        Where the optical axis meets the image: shares of width and height, from the top left. Other points
        than the centre shift the lens: vertical lines stay parallel in a view that shows more above.

    Raises
    ------
    CameraPathError
        The matrix is not rigid or holds a NaN, or a number is out of range.
    """

    world_from_camera: Matrix
    fov_deg: float
    width: int
    height: int
    principal_point: tuple[float, float] = CENTRE

    def __post_init__(self) -> None:
        matrix = np.asarray(self.world_from_camera, np.float64)
        _check_rigid(matrix)
        if not 0.0 < self.fov_deg < 180.0:
            raise CameraPathError(f"the field of view is {self.fov_deg} deg; it must lie in (0, 180)")
        if self.width < 1 or self.height < 1:
            raise CameraPathError(f"an image of {self.width}x{self.height} pixels can't be rendered")
        if not np.isfinite(self.principal_point).all():
            raise CameraPathError(f"the principal point is {self.principal_point}; it must be finite")
        plain = {
            "world_from_camera": matrix,
            "fov_deg": float(self.fov_deg),
            "width": int(self.width),
            "height": int(self.height),
            "principal_point": tuple(map(float, self.principal_point)),
        }
        for name, value in plain.items():  # of NumPy's types, too: JSON has others
            object.__setattr__(self, name, value)

    @cached_property
    def focal_px(self) -> float:
        """Focal length in pixels."""
        return 0.5 * self.height / math.tan(math.radians(0.5 * self.fov_deg))

    @property
    def pixel_angle(self) -> float:
        """Angle between the rays of adjacent pixels at the principal point, radians."""
        return 1.0 / self.focal_px

    @property
    def eye(self) -> Matrix:
        """Position in the world, (3,)."""
        return self.world_from_camera[:3, 3]

    @cached_property
    def direction_from_pixel(self) -> Matrix:
        """McMillan's P (§4, Eq. 3-1 there): pixel (x, y, 1) -> world direction of unit depth, (3, 3).

        Depth is measured along the optical axis: ``eye + depth * (P @ (x, y, 1))`` is the point.
        """
        f = self.focal_px
        x, y = self.principal_point[0] * self.width, self.principal_point[1] * self.height
        camera_from_pixel = np.array([[1.0 / f, 0.0, -x / f], [0.0, -1.0 / f, y / f], [0.0, 0.0, -1.0]])
        result: Matrix = self.world_from_camera[:3, :3] @ camera_from_pixel
        return result

    @cached_property
    def pixel_from_direction(self) -> Matrix:
        """Inverse of :attr:`direction_from_pixel`; the third row of the product is the depth, (3, 3)."""
        result: Matrix = np.linalg.inv(self.direction_from_pixel).astype(np.float64)
        return result

    def is_same_view(self, other: Camera) -> bool:
        """Whether pose and intrinsics are exactly equal."""
        intrinsics = [
            (camera.width, camera.height, camera.fov_deg, camera.principal_point) for camera in (self, other)
        ]
        is_same_pose = np.array_equal(self.world_from_camera, other.world_from_camera)
        return is_same_pose and intrinsics[0] == intrinsics[1]


def _check_rigid(matrix: Matrix) -> None:
    """Raise CameraPathError unless the matrix is a rotation and a translation."""
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise CameraPathError(f"a pose must be a 4x4 matrix of finite numbers, not {matrix}")
    if np.abs(matrix[3] - LAST_ROW).max() > ROW_TOLERANCE:
        raise CameraPathError(f"the last row of a pose must be 0 0 0 1, not {matrix[3]}")
    rotation = matrix[:3, :3]
    defect = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
    if defect > RIGID_TOLERANCE:
        raise CameraPathError(
            f"the pose is not rigid: R^T R - 1 has an entry of {defect:.3g} (at most {RIGID_TOLERANCE:g}); "
            "remove scale and shear"
        )
    if np.linalg.det(rotation) < 0.0:
        raise CameraPathError("the pose is a reflection (determinant -1): flip one axis")


def look_at(eye: npt.ArrayLike, target: npt.ArrayLike, up: npt.ArrayLike = (0.0, 1.0, 0.0)) -> Matrix:
    """Poses of cameras at `eye` that look at `target`.

    Parameters
    ----------
    eye, target, up : (..., 3)

    Returns
    -------
    (..., 4, 4) float64

    Raises
    ------
    CameraPathError
        Eye and target coincide, or `up` points along the view.
    """
    position, aim, upward = np.broadcast_arrays(*(np.asarray(v, np.float64) for v in (eye, target, up)))
    back = position - aim
    right = np.cross(upward, back)
    lengths = [np.linalg.norm(axis, axis=-1, keepdims=True) for axis in (back, right)]
    if (is_lost := (np.minimum(*lengths) == 0.0)[..., 0]).any():
        where = tuple(np.argwhere(is_lost)[0])
        raise CameraPathError(
            f"a camera at {position[where]} can't look at {aim[where]} with {upward[where]} up"
        )
    back, right = back / lengths[0], right / lengths[1]
    poses = np.zeros((*position.shape[:-1], 4, 4))
    poses[..., :3, :] = np.stack([right, np.cross(back, right), back, position], axis=-1)
    poses[..., 3, 3] = 1.0
    return poses


@dataclass(frozen=True, eq=False)
class PlanarWarp:
    """McMillan's planar image-warping equation between two cameras (§3.3, Fig. 5).

    A pixel x = (x, y, 1) of generalised disparity delta = 1 / depth maps to
    ``x + change @ x + delta * epipole``, up to scale; the third component is the ratio of the new depth to
    the old. The difference from the identity is stored: small motion loses no digits in float32.

    Attributes
    ----------
    change : (3, 3) float64
        ``P2^-1 P1 - 1``.
    epipole : (3,) float64
        ``P2^-1 (C1 - C2)``.
    """

    change: Matrix
    epipole: Matrix


def planar_warp(source: Camera, target: Camera) -> PlanarWarp:
    """Warp from pixels of `source` to pixels of `target`; exactly zero between equal views."""
    if source.is_same_view(target):
        return PlanarWarp(np.zeros((3, 3)), np.zeros(3))
    inverse = target.pixel_from_direction
    return PlanarWarp(inverse @ source.direction_from_pixel - np.eye(3), inverse @ (source.eye - target.eye))
