"""Resampled importance sampling: means are kept, whatever the contributions; their noise is not."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from enfilade.arrays import Array3f, Bool, Float, UInt, rows
from enfilade.device import active
from enfilade.kernels.random import one_sequence
from enfilade.scene.mitsuba.resampling import resample
from enfilade.scene.mitsuba.shadow_rays import Target

COUNT = 1 << 16


@pytest.fixture(autouse=True)
def variant():
    mi.set_variant(active().variant)


def drawn(values, count):
    """Contributions and the candidates that were chosen, of emitters with these contributions."""
    table = Float(values)

    def candidate(place):
        number = dr.minimum(UInt(place.x * len(values)), len(values) - 1)
        value = dr.gather(Float, table, number)
        target = Target(mi.Point3f(Float(number), 0.0, 0.0), Bool(False))
        return target, (Array3f(value, 2.0 * value, 0.5 * value),)

    sampler = one_sequence(COUNT)
    target, (found,) = resample(candidate, count, sampler)
    dr.eval(target.point, found, sampler.dimension)
    return rows(found), np.array(target.point.x), int(sampler.dimension[0])


@pytest.mark.parametrize("count", [1, 2, 4, 8])
@pytest.mark.parametrize("values", [[1.0, 0.0, 6.0, 0.5], [3.0, -1.0, 0.0, -2.0, 8.0, 0.0, 0.0, 1.0]])
def test_the_mean_of_all_contributions_is_kept(values, count):
    found, _, _ = drawn(values, count)
    error = found[:, 0].std() / np.sqrt(COUNT)
    assert found[:, 0].mean() == pytest.approx(np.mean(values), abs=4.0 * error + 1e-5)
    np.testing.assert_allclose(found[:, 1], 2.0 * found[:, 0], rtol=1e-5)


def test_with_a_candidate_for_each_emitter_there_is_no_noise_of_the_choice():
    values = [1.0, 0.0, 6.0, 0.5]
    found, chosen, dimension = drawn(values, 4)
    np.testing.assert_allclose(found[:, 0], np.mean(values), rtol=1e-5)
    share = np.bincount(chosen.astype(int), minlength=4) / COUNT
    np.testing.assert_allclose(share, np.array(values) / np.sum(values), atol=0.01)
    assert dimension == 8  # a point and a number for each candidate


def test_what_is_not_finite_stays_so():
    found, _, _ = drawn([1.0, float("nan"), 6.0, 0.5], 4)
    assert np.isnan(found).all()
