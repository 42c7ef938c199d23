"""``enfilade render`` announces the cost of a reference before it begins."""

import pytest

from enfilade.cli.render import PATHS_PER_CPU_S


@pytest.mark.parametrize(
    ("method", "options", "is_announced"),
    [("reference", (), True), ("reference", ("--quiet",), False), ("paper", (), False)],
)
def test_the_paths_of_a_reference_are_announced(
    run, jobs, scene, camera_path, tmp_path, method, options, is_announced
):
    size = ("--size", "64x48", "--spp", "50000", "--device", "auto")
    result = run(
        "render", scene, "--path", camera_path, "--out", tmp_path / "run", "--method", method, *size, *options
    )
    assert len(jobs) == 1
    hours = 3 * 64 * 48 * 50_000 / PATHS_PER_CPU_S / 3600.0
    announced = (
        "reference: 461 million paths (3 frames of 64x48, 50000 a pixel), "
        f"about {60.0 * hours:.1f} min of CPU time in an interior"
    )
    assert (announced in result.stderr) == is_announced
