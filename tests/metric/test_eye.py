"""Eq. 5, its floor, and the projection on channels."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enfilade.metric import Pursuit
from enfilade.metric.eye import channel_speed, held_smear, retinal_speed, retinal_velocity, smeared_contrast


def test_equation_5():
    # By hand; the first three fall under the floor.
    image = np.float32([0.0, 0.5, 0.8333, 2.0, 5.0, 10.0, 16.0, 30.0, 97.4, 120.0])
    retina = [0.15, 0.15, 0.15, 0.210, 0.750, 1.65, 2.73, 5.25, 17.4, 40.0]
    np.testing.assert_allclose(retinal_speed(image, Pursuit.PURSUIT), retina, rtol=2e-3)
    np.testing.assert_array_equal(retinal_speed(image, Pursuit.NONE), np.maximum(image, np.float32(0.15)))


@given(st.floats(0, 300), st.floats(0, 360), st.sampled_from([Pursuit.PURSUIT, Pursuit.NONE]))
def test_retinal_velocity_has_the_direction_of_the_image(image, angle, eye):
    heading = np.radians(angle)
    velocity = np.float32([[image * np.cos(heading)], [image * np.sin(heading)]])
    retinal = retinal_velocity(velocity, eye)
    across = retinal[0] * velocity[1] - retinal[1] * velocity[0]
    assert abs(across[0]) <= 1e-4 * max(image, 1.0) ** 2
    assert channel_speed(retinal, None)[0] == pytest.approx(
        retinal_speed(np.float32([image]), eye)[0], rel=1e-3
    )


def test_projection_is_on_the_frequency_vector():
    # Moving right at 30 deg/s unpursued: upright bars (frequency vector along x) blur, level ones
    # keep full acuity, at 60 degrees half the speed counts.
    velocity = np.float32([[30.0], [0.0]])
    assert channel_speed(velocity, 0.0)[0] == pytest.approx(30.0)
    assert channel_speed(velocity, -90.0)[0] == np.float32(0.15)
    assert channel_speed(velocity, 60.0)[0] == pytest.approx(15.0, rel=1e-5)
    # y points down, and theta turns from x towards y.
    downwards_right = np.float32([[10.0], [10.0 * 3**0.5]])
    assert channel_speed(downwards_right, 60.0)[0] == pytest.approx(20.0, rel=1e-5)
    assert channel_speed(downwards_right, -30.0)[0] == pytest.approx(0.15, abs=1e-5)


def test_a_held_frame_smears_for_an_eye_that_follows():
    velocity = np.array([10.0, 0.0], dtype=np.float32).reshape(2, 1, 1)
    smear = held_smear(velocity, Pursuit.PURSUIT, 1.0 / 60.0)
    # The eye follows at 0.82 * 10 + 0.15 deg/s (Eq. 5).
    assert smear[:, 0, 0] == pytest.approx([8.35 / 60.0, 0.0], rel=1e-5)
    assert held_smear(velocity, Pursuit.NONE, 1.0 / 60.0) is None
    assert held_smear(velocity, Pursuit.PURSUIT, 0.0) is None
    # One whole period under the smear leaves nothing; along the bars nothing is lost.
    period_cpd = 60.0 / 8.35
    assert smeared_contrast(smear, 0.0, period_cpd) == pytest.approx(0.0, abs=1e-5)
    assert smeared_contrast(smear, 90.0, period_cpd) == pytest.approx(1.0, abs=1e-5)
    assert smeared_contrast(smear, 0.0, 0.5 * period_cpd) == pytest.approx(2.0 / np.pi, rel=1e-4)
