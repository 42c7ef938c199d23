"""Forward 3D warp of a keyframe (McMillan 1997) with adaptive splats (Shade et al. 1998; §2.2)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from enfilade.arrays import Array2f, Array3f, Bool, Float, UInt, image, lanes, matrix3, vector3
from enfilade.camera.pinhole import Camera, planar_warp
from enfilade.kernels.bilinear import bilinear_taps
from enfilade.kernels.rays import pixel_centres
from enfilade.kernels.reproject import reproject, warp_jacobian
from enfilade.methods.paper.disparity import disparity_gradient, outline_pixels
from enfilade.methods.paper.splat import EMPTY, INFINITE, Splats, splat_nearest
from enfilade.methods.walkthrough import Walkthrough
from enfilade.records import Geometry, Halves, Keyframe, Warped
from enfilade.settings import WarpSettings

PIXEL_VARIANCE = 1.0 / 12.0  # of positions over a pixel along an axis, square pixels


def warp_keyframe(keyframe: Keyframe, camera: Camera, settings: WarpSettings) -> Warped:
    """Reproject a keyframe to another camera.

    Each pixel of the keyframe becomes a splat, stretched by the Jacobian of the warp. The nearest splat over
    a pixel's centre wins: a z-buffer shows the same surfaces as McMillan's occlusion-compatible order, in any
    order. Colours are interpolated bilinearly among neighbours in the keyframe on the same surface.

    Returns
    -------
    Warped
    """
    landing = _land(keyframe.geometry, camera)
    longest = settings.max_magnification
    keys = splat_nearest(
        _within(landing.splats, longest),
        width=camera.width,
        height=camera.height,
        reach=2.0 * longest,  # more than half of the largest box around two such sides
    )
    dr.eval(keys)
    return _resample(keyframe, camera, landing, keys, settings.depth_tolerance)


def warped_pair(walk: Walkthrough, first: Keyframe, last: Keyframe, frame: int) -> tuple[Warped, Warped]:
    """Both keyframes of a segment, reprojected to a frame between them."""
    camera, settings = walk.path.cameras[frame], walk.settings[WarpSettings]
    return warp_keyframe(first, camera, settings), warp_keyframe(last, camera, settings)


@dataclass(frozen=True)
class _Landing:
    """Positions of the pixels of a keyframe in another image, as lanes of the keyframe."""

    splats: Splats
    disparity: Any  # Float, in the keyframe
    gradient: Any  # Array2f


def _land(source: Geometry, camera: Camera) -> _Landing:
    """Reproject all pixels of a keyframe."""
    warp = planar_warp(source.camera, camera)
    change, epipole = matrix3(warp.change), vector3(warp.epipole)
    disparity, gradient = lanes(source.disparity), lanes(disparity_gradient(source))

    # Reproject the centres, and differentiate.
    x, y = pixel_centres(source.camera)
    flow, ratio, is_ahead = reproject(x, y, disparity, change=change, epipole=epipole)
    by_x, by_y = warp_jacobian(x, y, disparity, gradient, change=change, epipole=epipole)

    # Differentiate the inverse depth, too.
    inverse_depth = disparity / ratio
    rise = Array2f(change[2, 0], change[2, 1]) + gradient * epipole.z  # of the depth ratio
    slope = (gradient - inverse_depth * rise) / ratio
    splats = Splats(x + flow.x, y + flow.y, inverse_depth, by_x, by_y, slope, is_ahead)
    dr.eval(vars(splats), disparity, gradient)
    return _Landing(splats, disparity, gradient)


def _within(splats: Splats, longest: float) -> Splats:
    """Splats whose sides are at most as long as this, in pixels."""
    square = longest * longest
    is_short = (dr.squared_norm(splats.by_x) <= square) & (dr.squared_norm(splats.by_y) <= square)
    return replace(splats, is_splat=splats.is_splat & is_short)


def _resample(keyframe: Keyframe, camera: Camera, landing: _Landing, keys: Any, tolerance: float) -> Warped:
    """Interpolate the keyframe at the winning splats."""
    height, width = camera.height, camera.width
    source, splats = keyframe.geometry.camera, landing.splats

    # Unpack the keys of the z-buffer.
    is_empty = keys == EMPTY
    winner: Any = UInt(keys & 0xFFFF_FFFF)
    depth: Any = dr.reinterpret_array(Float, UInt(keys >> 32))

    # Invert the Jacobian for the position in the keyframe.
    at_x, at_y, by_x, by_y = (
        dr.gather(type(v), v, winner, ~is_empty) for v in (splats.x, splats.y, splats.by_x, splats.by_y)
    )
    target = pixel_centres(camera)
    dx, dy = target.x - at_x, target.y - at_y
    det = by_x.x * by_y.y - by_y.x * by_x.y
    offset = Array2f(by_y.y * dx - by_y.x * dy, by_x.x * dy - by_x.y * dx) / det
    winner_row = winner // source.width
    centre = Array2f(winner - winner_row * source.width, winner_row) + 0.5
    at = centre + offset

    # Estimate the area that the pixel averages: that of the keyframe's pixels, and of the interpolation.
    beyond = at - 0.5 - dr.floor(at - 0.5)
    interpolated = beyond * (1.0 - beyond)
    footprint = det * (PIXEL_VARIANCE + 0.5 * (interpolated.x + interpolated.y))

    # Interpolate among the neighbours on the winner's surface.
    shape_indices = lanes(keyframe.geometry.shape_index)
    outlines = lanes(outline_pixels(keyframe.geometry, tolerance))
    halves = lanes(keyframe.shading.first), lanes(keyframe.shading.second)
    shape_index = dr.gather(UInt, shape_indices, winner, ~is_empty)
    disparity = dr.gather(Float, landing.disparity, winner, ~is_empty)
    gradient = dr.gather(Array2f, landing.gradient, winner, ~is_empty)
    total, colors, is_mixed = Float(0), [Array3f(0), Array3f(0)], Bool(False)
    for tap in bilinear_taps(at.x, at.y, width=source.width, height=source.height):
        step = Array2f(tap.column, tap.row) + 0.5 - centre
        expected = disparity + dr.dot(gradient, step)
        jump = dr.abs(dr.gather(Float, landing.disparity, tap.lane) - expected)
        is_same = (dr.gather(UInt, shape_indices, tap.lane) == shape_index) & (jump <= tolerance * disparity)
        weight = dr.select(is_same & ~is_empty, tap.weight, 0.0)  # the position may be NaN where it is empty
        total += weight
        is_mixed |= (weight > 0.0) & dr.gather(Bool, outlines, tap.lane)
        colors = [c + weight * dr.gather(Array3f, h, tap.lane) for c, h in zip(colors, halves, strict=True)]

    # Normalize, and clear disoccluded pixels.
    is_disoccluded = is_empty | (total <= 0.0)
    inverse = dr.select(is_disoccluded, 0.0, 1.0 / total)
    magnification, footprint = (dr.select(is_disoccluded, 0.0, value) for value in (det, footprint))
    first, second = (color * inverse for color in colors)
    depth = dr.select(is_disoccluded | (depth >= INFINITE), 0.0, depth)
    shape_index = dr.select(is_disoccluded, 0, shape_index)
    is_mixed &= ~is_disoccluded
    dr.eval(first, second, depth, shape_index, magnification, footprint, is_disoccluded, is_mixed)
    return Warped(
        shading=Halves(image(first, height, width), image(second, height, width)),
        depth=image(depth, height, width),
        shape_index=image(shape_index, height, width),
        magnification=image(magnification, height, width),
        footprint=image(footprint, height, width),
        is_disoccluded=image(is_disoccluded, height, width),
        is_mixed=image(is_mixed, height, width),
    )
