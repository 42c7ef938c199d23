"""The denoiser: as many threads as Dr.Jit has, and the same pixels."""

import os

import drjit as dr
import numpy as np

from enfilade.methods import denoise as module


def test_threads_are_those_of_dr_jit_and_change_no_pixel(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(4))
    rng = np.random.default_rng(1)
    color, albedo, normal = rng.random((3, 60, 80, 3), dtype=np.float32)
    images = []
    for threads in (2, 1):
        dr.set_thread_count(threads)
        images.append(module.denoise(color, albedo, normal).tobytes())
        assert module._device(threads).get_int("numThreads") == threads
        assert module._device.cache_info().currsize == 1
    assert images[0] == images[1]
    module._device.cache_clear()
