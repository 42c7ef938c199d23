"""Between NumPy and Dr.Jit."""

import drjit as dr
import numpy as np

from enfilade.arrays import Array3f, lanes, rows


def test_rows_of_any_length_by_no_kernel_of_their_own():
    def there_and_back(count):
        values = np.random.default_rng(count).random((count, 3)).astype(np.float32)
        np.testing.assert_array_equal(rows(Array3f(*(lanes(axis) for axis in values.T))), values)

    there_and_back(7)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        for count in (1, 5, 1000):
            there_and_back(count)
        kernels = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert all(kernel["cache_hit"] and not kernel["cache_disk"] for kernel in kernels)
