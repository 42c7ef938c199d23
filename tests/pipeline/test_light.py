"""The light of a shot: what frames between the keyframes know of what they see."""

import drjit as dr
import numpy as np
import pytest

from enfilade.camera import load_path
from enfilade.errors import DamagedFileError
from enfilade.methods.decoupled import light_of
from enfilade.monitor import Silence
from enfilade.pipeline.decoupled import DecoupledFrames
from enfilade.pipeline.job import Job
from enfilade.pipeline.kept import either_side
from enfilade.pipeline.light import LEAST_HOLES, LEAST_SHARE, LightTable
from enfilade.pipeline.survey import survey_path
from enfilade.pipeline.units import segments_of
from enfilade.pipeline.workshop import Workshop
from enfilade.settings import Settings
from enfilade.store import Run
from studies.scenes import write_scene

FRAMES = tuple(range(20, 36, 2))  # the camera turns: between the keyframes something else is seen


@pytest.fixture(scope="module")
def lit(tmp_path_factory):
    """A workshop, and the light of its shot."""
    folder = tmp_path_factory.mktemp("light")
    files = write_scene("room", folder / "room", preset="small")
    path = load_path(files.path, size=(96, 72), frames=FRAMES)
    settings = Settings.from_tables({"light": {"spacing": 7, "paths": 4}, "keyframes": {"adaptation": 0.0}})
    job = Job(files.scene, path, settings, "decoupled")
    renderer = job.open_renderer()
    with Run.open(folder / "run", job.identity(renderer)) as run:
        yield _begun(job, renderer, run)


def _begun(job, renderer, run):
    """A workshop, and the light of the only shot, of which nothing is traced yet."""
    workshop = Workshop(job, renderer, run, Silence())
    survey = survey_path(workshop.views, job.path, job.settings, Silence())
    return workshop, LightTable(workshop, segments_of(job, survey)[0])


def _known(workshop, table, frame):
    """Share of a frame's lit pixels whose light some page knows."""
    near, _ = table.around(frame)
    has_diffuse = workshop.views[frame].geometry.has_diffuse
    return (np.array(near.pages[0].shape_indices) > 0)[has_diffuse.ravel()].mean()


def test_pages_between_the_keyframes_fill_the_holes(lit):
    workshop, table = lit
    assert table.keyframes == [0, 7]
    with pytest.raises(ValueError, match="unit 'light 20-34' is not finished"):
        table.around(3)
    before = [
        1.0 - table._holes(f, []).sum() / workshop.views[f].geometry.has_diffuse.sum() for f in range(8)
    ]
    assert min(before) < 1.0 - 2 * LEAST_HOLES
    for segment in table.segments:
        table.prepare(segment)
    after = [_known(workshop, table, frame) for frame in range(8)]
    assert min(after) > 1.0 - 2 * LEAST_HOLES
    assert all(b <= a for b, a in zip(before, after, strict=True))
    (line,) = (line for line in workshop.run.lines() if line["unit"].startswith("light"))
    assert line["fills"]
    # At the segment's ends, where its fills are not asked any more, they count for nothing.
    assert {table._fill_shares(frame)[f] for frame in (0, 7) for f in table._fill_shares(frame)} == {
        LEAST_SHARE
    }
    filled = FRAMES.index(line["fills"][0])
    assert table._fill_shares(filled)[filled] == 1.0
    pages = [line for line in workshop.run.lines() if line["unit"].startswith("keyframe")]
    # A page that fills holes is small.
    whole = [p["rays"]["light"] for p in pages if p["frame"] in (20, 34)]
    small = [p["rays"]["light"] for p in pages if p["frame"] in line["fills"]]
    assert max(small) < 0.5 * min(whole)
    # Which holes it filled, only what prepares its segment can tell: it is not traced whole in silence.
    lost = line["fills"][0]
    workshop.run.forget(f"keyframes/{lost:04d}.exr")
    with pytest.raises(DamagedFileError, match=f"{lost:04d}.exr is missing"):
        LightTable(workshop, table.segments).trace(FRAMES.index(lost))


def test_cells_know_what_no_draft_sees(lit):
    workshop, table = lit
    estimates = [table.drafts.scout(frame) for frame in table.keyframes]
    assert all(len(e.keys) for e in estimates)
    lines = {line["unit"]: line for line in workshop.run.lines()}
    assert lines["cells 20"]["cells"] == len(estimates[0].keys)
    for estimate in estimates:
        assert np.isfinite(estimate.sums).all()
        assert (estimate.counts > 0).all()
        assert np.unique(estimate.keys).size == len(estimate.keys)


@pytest.mark.parametrize(
    ("fills", "frame", "expected"),
    [([], 3, []), ([2, 5, 9], 4, [2, 5]), ([2, 5, 9], 5, [5]), ([2, 5, 9], 1, [2]), ([2, 5, 9], 12, [9])],
)
def test_two_fills_around_a_frame(fills, frame, expected):
    assert either_side(fills, frame) == expected


def test_a_denoiser_takes_the_place_of_smoothing(tmp_path):
    pytest.importorskip("pyoidn")
    files = write_scene("room", tmp_path / "room", preset="small")
    path = load_path(files.path, size=(96, 72), frames=(20, 22))

    def light(paths, denoiser):
        settings = Settings.from_tables({"light": {"paths": paths, "denoiser": denoiser}})
        job = Job(files.scene, path, settings, "decoupled")
        renderer = job.open_renderer()
        with Run.open(tmp_path / f"{paths}-{denoiser}", job.identity(renderer)) as run:
            _, table = _begun(job, renderer, run)
            for segment in table.segments:
                table.prepare(segment)
            near, _ = table.around(0)
            return light_of(near.pages[0])

    truth, plain, fast, again = light(128, "none"), light(4, "none"), light(4, "fast"), light(4, "fast")

    def error(found):
        return np.abs(np.log((found + 0.05) / (truth + 0.05))).mean()

    assert (fast != plain).any()
    assert error(fast) < 1.3 * error(plain)
    np.testing.assert_array_equal(fast, again)


def test_nothing_is_compiled_after_the_first_frames(tmp_path):
    files = write_scene("atrium", tmp_path / "atrium", preset="small")
    path = load_path(files.path, size=(64, 48), frames=tuple(range(20, 36)))
    settings = Settings.from_tables({"light": {"spacing": 5, "paths": 4}})
    job = Job(files.scene, path, settings, "decoupled")
    renderer = job.open_renderer()
    with Run.open(tmp_path / "run", job.identity(renderer)) as run:
        workshop, table = _begun(job, renderer, run)
        for segment in table.segments:
            table.prepare(segment)
        frames = DecoupledFrames(workshop)
        for frame in range(4):
            frames.shade(table, frame)
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            for frame in range(4, 16):
                frames.shade(table, frame)
            kernels = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert kernels
    assert not [k["operation_count"] for k in kernels if not k["cache_hit"] or k["cache_disk"]]
