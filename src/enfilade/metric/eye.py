"""Eye movements: how fast an image moves over the retina (§3.3, Eq. 5, Daly 1998)."""

from __future__ import annotations

import enum
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

__all__ = ["Pursuit", "channel_speed", "held_smear", "retinal_speed", "retinal_velocity"]

Float32Array: TypeAlias = npt.NDArray[np.float32]

EYE_DRIFT_DEG_S = 0.15  # §3.3, v_Min: drift of the eye that fixates
PURSUIT_MAX_DEG_S = 80.0  # §3.3, v_Max: fastest smooth pursuit
PURSUIT_EFFICIENCY = 0.82  # §3.3, no unit: share of a target's speed that the eye takes up

SLOWEST_DEG_S = 1e-6  # below this a direction of motion means nothing


class Pursuit(enum.Enum):
    """What the eye does while the image moves (§3.3).

    PURSUIT
        It follows the motion at each pixel as well as it can (Eq. 5). Segment splitting uses this.
    NONE
        It stands still: the image moves over the retina at its own velocity.
    BOTH
        Either may happen: each channel takes the larger sensitivity of the two.
    """

    PURSUIT = "pursuit"
    NONE = "none"
    BOTH = "both"

    @property
    def hypotheses(self) -> tuple[Pursuit, ...]:
        """The single eye movements to evaluate, of which the most sensitive counts."""
        return (Pursuit.PURSUIT, Pursuit.NONE) if self is Pursuit.BOTH else (self,)


def retinal_speed(image_speed_deg_s: Float32Array, pursuit: Pursuit) -> Float32Array:
    """Speed over the retina of an image that moves (Eq. 5, with a floor).

    v = max(abs(v_I - min(0.82 v_I + 0.15, 80)), 0.15) with pursuit, max(v_I, 0.15) without.

    Parameters
    ----------
    image_speed_deg_s : (...) float32
        Speed v_I of the image, degrees per second, 0 or more.
    pursuit : Pursuit
        PURSUIT or NONE.

    Returns
    -------
    (...) float32
        Degrees per second, never below the eye's drift of 0.15.

    Notes
    -----
    As printed, Eq. 5 is zero at v_I = 0.833 deg/s and negative below, where Eq. 4 would make the
    viewer blind. The eye is never stiller than its drift, hence the floor.
    """
    if pursuit is Pursuit.NONE:
        return np.maximum(image_speed_deg_s, np.float32(EYE_DRIFT_DEG_S))
    eye = PURSUIT_EFFICIENCY * image_speed_deg_s + EYE_DRIFT_DEG_S
    over_retina: Float32Array = image_speed_deg_s - np.minimum(eye, PURSUIT_MAX_DEG_S)
    return np.maximum(np.abs(over_retina), np.float32(EYE_DRIFT_DEG_S))


def retinal_velocity(velocity_deg_s: Float32Array, pursuit: Pursuit) -> Float32Array:
    """Velocity over the retina: the direction of the image's, with the speed of Eq. 5.

    Parameters
    ----------
    velocity_deg_s : (2, ...) float32
        Image velocity, degrees per second: to the right, down.
    pursuit : Pursuit
        PURSUIT or NONE.

    Returns
    -------
    (2, ...) float32
        Degrees per second. Zero where the image stands still; the floor is left to
        `channel_speed`.
    """
    if pursuit is Pursuit.NONE:
        return velocity_deg_s
    speed = np.hypot(velocity_deg_s[0], velocity_deg_s[1])
    share = retinal_speed(speed, pursuit)
    share /= np.maximum(speed, np.float32(SLOWEST_DEG_S), out=speed)
    return velocity_deg_s * share


def held_smear(velocity_deg_s: Float32Array, pursuit: Pursuit, hold_s: float) -> Float32Array | None:
    """How far a held frame moves over the retina of an eye that follows the motion.

    The display shows a moving pattern in jumps; between them it stands, and the eye does not.

    Parameters
    ----------
    velocity_deg_s : (2, ...) float32
        Image velocity, degrees per second.
    pursuit : Pursuit
        PURSUIT or NONE.
    hold_s : float
        How long a frame is lit, seconds.

    Returns
    -------
    (2, ...) float32 or None
        Degrees, in the direction of the motion; None for an eye that rests.
    """
    if pursuit is Pursuit.NONE:
        return None
    smear: Float32Array = velocity_deg_s - retinal_velocity(velocity_deg_s, pursuit)
    smear *= np.float32(hold_s)
    return smear


def _along(vector: Float32Array, theta_deg: float | Float32Array | None) -> Float32Array:
    """Component of a field along a direction, signed; its length where there is none."""
    across, down = vector
    if theta_deg is None:
        length: Float32Array = np.hypot(across, down)
        return length
    theta = np.radians(np.asarray(theta_deg, dtype=np.float32))
    along: Float32Array = np.cos(theta) * across
    along += np.sin(theta) * down
    return along


def smeared_share(
    smear_deg: Float32Array, theta_deg: float | Float32Array | None, frequency_cpd: float
) -> Float32Array:
    """Contrast that a smear leaves of a channel: the spectrum of a box as long as the smear.

    Parameters
    ----------
    smear_deg : (2, ...) float32
        From `held_smear`.
    theta_deg : float, float32 or None
        Direction of the frequency vector, the same everywhere or not; None for the base band.
    frequency_cpd : float
        Cycles per degree.

    Returns
    -------
    (...) float32
        0..1.
    """
    along = _along(smear_deg, theta_deg)
    share: Float32Array = np.abs(np.sinc(along * np.float32(frequency_cpd)))
    return share


def channel_speed(
    retinal_velocity_deg_s: Float32Array, theta_deg: float | Float32Array | None
) -> Float32Array:
    """Speed over the retina along the frequency vector of a channel (§3.4).

    A pattern blurs along its motion: bars across it lose their detail, bars along it keep theirs.
    So the retinal velocity is projected on the direction in which the bars repeat.

    Parameters
    ----------
    retinal_velocity_deg_s : (2, ...) float32
        From `retinal_velocity`, degrees per second.
    theta_deg : float, float32 or None
        Direction of the frequency vector (the normal of the bars), degrees from x (right) towards
        y (down), the same everywhere or not; None for the base band, which has no direction and
        takes the whole speed.

    Returns
    -------
    (...) float32
        Degrees per second, never below the eye's drift of 0.15.
    """
    along = _along(retinal_velocity_deg_s, theta_deg)
    if theta_deg is not None:
        np.abs(along, out=along)
    np.maximum(along, np.float32(EYE_DRIFT_DEG_S), out=along)
    return along
