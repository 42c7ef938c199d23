"""McMillan's painter's algorithm: the keyframe's pixels in occlusion-compatible order, later ones overwrite.

No depth is compared. Of two points that the new camera sees along one ray, the farther one has the
larger angle, at the old eye, from the direction of the new eye: so the pixels whose rays turn most from
that direction are drawn first. In the image they run towards the epipole where the camera has moved
forwards, and away from it where it has moved backwards.
"""

import numpy as np

from twins.splat import is_within_reach, parallelogram


def occlusion_compatible_order(source, target):
    """Flat indices of the pixels of the source camera, the first to be drawn first."""
    y, x = np.mgrid[: source.height, : source.width] + 0.5
    rays = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3) @ source.direction_from_pixel.T
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    return np.argsort(rays @ (target.eye - source.eye), kind="stable")


def painted(splats, order, width, height, reach):
    """Lane that was drawn last over each target pixel, -1 where none was, (H, W).

    `splats` as for `twins.splat.nearest`; their depths are not looked at.
    """
    winner = np.full((height, width), -1)
    for lane in order:
        x, y, _, by_x, by_y, _, is_splat = splats[lane]
        if not is_splat or not is_within_reach(by_x, by_y, reach):
            continue
        # Draw into the part of the image around the splat alone.
        left, top = int(max(x - reach - 1, 0)), int(max(y - reach - 1, 0))
        right, bottom = int(min(x + reach + 2, width)), int(min(y + reach + 2, height))
        if right <= left or bottom <= top:
            continue
        for column, row, _, _ in parallelogram(x - left, y - top, by_x, by_y, right - left, bottom - top):
            winner[top + row, left + column] = lane
    return winner
