"""Eye movements: the velocity of an image over the retina (§3.3, Eq. 5, Daly 1998).

Velocities are (2, ...) float32 arrays, to the right and down, degrees per second. A direction theta is that
of a channel's frequency vector (the normal of its bars), degrees from x (right) towards y (down), one or a
map; None in the base band, which has no direction and takes the whole speed.
"""

from __future__ import annotations

import numpy as np

from enfilade.records import F32
from enfilade.settings import Pursuit

EYE_DRIFT_DEG_S = 0.15  # §3.3, v_Min: drift of the eye that fixates
PURSUIT_MAX_DEG_S = 80.0  # §3.3, v_Max: fastest smooth pursuit
PURSUIT_EFFICIENCY = 0.82  # §3.3, no unit: gain of smooth pursuit

SLOWEST_DEG_S = 1e-6  # keeps the direction of motion finite


def retinal_speed(image_speed_deg_s: F32, pursuit: Pursuit) -> F32:
    """Speed over the retina of an image that moves at v_I >= 0 (Eq. 5, with a floor), deg/s.

    v = max(abs(v_I - min(0.82 v_I + 0.15, 80)), 0.15) with pursuit, max(v_I, 0.15) without.

    Notes
    -----
    As printed, Eq. 5 is zero at v_I = 0.833 deg/s and negative below, where Eq. 4 would make the
    viewer blind. The eye is never stiller than its drift, hence the floor.
    """
    if pursuit is Pursuit.NONE:
        return np.maximum(image_speed_deg_s, np.float32(EYE_DRIFT_DEG_S))
    eye = PURSUIT_EFFICIENCY * image_speed_deg_s + EYE_DRIFT_DEG_S
    over_retina: F32 = image_speed_deg_s - np.minimum(eye, PURSUIT_MAX_DEG_S)
    return np.maximum(np.abs(over_retina), np.float32(EYE_DRIFT_DEG_S))


def retinal_velocity(velocity_deg_s: F32, pursuit: Pursuit) -> F32:
    """Velocity over the retina: the direction of the image's, with the speed of Eq. 5.

    Zero where the image stands still; `channel_speed` applies the floor there.
    """
    if pursuit is Pursuit.NONE:
        return velocity_deg_s
    speed = np.hypot(velocity_deg_s[0], velocity_deg_s[1])
    ratio = retinal_speed(speed, pursuit)
    ratio /= np.maximum(speed, np.float32(SLOWEST_DEG_S), out=speed)
    return velocity_deg_s * ratio


def channel_speed(retinal_velocity_deg_s: F32, theta_deg: float | F32 | None) -> F32:
    """Speed over the retina along the frequency vector of a channel, 0.15 deg/s or more (§3.4).

    A pattern blurs along its motion: bars across it lose their detail, bars along it keep theirs.
    So the retinal velocity is projected on the direction in which the bars repeat.
    """
    along = np.abs(_along(retinal_velocity_deg_s, theta_deg))
    np.maximum(along, np.float32(EYE_DRIFT_DEG_S), out=along)
    return along


def held_smear(velocity_deg_s: F32, pursuit: Pursuit, hold_s: float) -> F32 | None:
    """Smear of a held frame over the retina of an eye that follows the motion, (2, ...) degrees.

    The display shows a moving pattern in jumps; between them it stands, and the eye moves on. None for an
    eye at rest, or where frames flash.

    Parameters
    ----------
    velocity_deg_s : (2, ...) float32
        Of the image.
    pursuit : Pursuit
        PURSUIT or NONE.
    hold_s : float
        Time for which a frame is lit, seconds.
    """
    if pursuit is Pursuit.NONE or not hold_s:
        return None
    smear: F32 = velocity_deg_s - retinal_velocity(velocity_deg_s, pursuit)
    smear *= np.float32(hold_s)
    return smear


def smeared_contrast(smear_deg: F32, theta_deg: float | F32 | None, frequency_cpd: float) -> F32:
    """Factor of a smear on the contrast of a channel, 0..1: the spectrum of a box of its length."""
    contrast: F32 = np.abs(np.sinc(_along(smear_deg, theta_deg) * np.float32(frequency_cpd)))
    return contrast


def _along(vector: F32, theta_deg: float | F32 | None) -> F32:
    """Component of a field along a direction, signed; its length where there is none."""
    across, down = vector
    if theta_deg is None:
        length: F32 = np.hypot(across, down)
        return length
    theta = np.radians(np.asarray(theta_deg, dtype=np.float32))
    along: F32 = np.cos(theta) * across
    along += np.sin(theta) * down
    return along
