"""Delivered frames and the video."""

from __future__ import annotations

import numpy as np
import pytest

from enfilade.errors import ImageError
from enfilade.images import open_sequence, read_exr, write_exr
from enfilade.monitor import Silence
from enfilade.runs import delivery
from enfilade.runs.delivery import analysis_tasks, clip_spans, video_tasks
from enfilade.runs.folder import RunFolder
from enfilade.runs.render import render
from support.toys import toy_job


def test_every_frame_belongs_to_a_clip():
    assert [len(span) for span in clip_spans(500)] == [240, 240, 20]
    first, second, video = video_tasks(241)
    assert (len(first.needs), second.needs[0].frame, video.needs) == (240, 240, (first.id, second.id))
    assert [task.frame for task in analysis_tasks(33)] == [0, 16, 32]


def test_frames_have_the_layers_that_are_asked_for(tmp_path):
    render(toy_job(tmp_path, 2, output={"layers": "all"}), tmp_path / "run", Silence())
    layers = read_exr(tmp_path / "run" / "frames" / "0001.exr")
    kinds = {"RGB": "f2", "Z": "f4", "P": "f4", "N": "f2", "albedo": "f2", "shape_index": "u4"}
    kinds |= {"forward": "f4", "backward": "f4", "provenance": "u4"}
    assert {name: layer.dtype.str[1:] for name, layer in layers.items()} == kinds
    np.testing.assert_allclose(layers["Z"], 4.0, rtol=1e-3)
    np.testing.assert_allclose(layers["P"][..., 2], 0.0, atol=2e-2)
    focal_px = 0.5 * 6 / np.tan(np.radians(25.0))
    np.testing.assert_allclose(layers["forward"][..., 0], -0.01 * focal_px / 4.0, rtol=1e-2)
    assert (layers["provenance"] == 1).all()


def test_the_video_shows_all_frames_whatever_its_clips(tmp_path, monkeypatch):
    monkeypatch.setattr(delivery, "CLIP_FRAMES", 3)
    job = toy_job(tmp_path, 7)
    render(job, tmp_path / "run", Silence())
    assert len(list((tmp_path / "run" / "clips").iterdir())) == 3
    images = list(open_sequence(tmp_path / "run" / "video.mkv"))
    assert len(images) == 7
    for number, image in enumerate(images, 1):
        frame = read_exr(tmp_path / "run" / "frames" / f"{number:04d}.exr")["RGB"].astype(np.float32)
        np.testing.assert_allclose(image, np.clip(frame, 0.0, 1.0), atol=2e-3)


@pytest.mark.parametrize("name", ["clips/0004.mkv", "video.mkv"])
def test_a_lost_part_of_the_video_is_encoded_again(tmp_path, monkeypatch, name):
    monkeypatch.setattr(delivery, "CLIP_FRAMES", 3)
    job = toy_job(tmp_path, 7)
    render(job, tmp_path / "run", Silence())
    before = RunFolder.read(tmp_path / "run").digest()
    (tmp_path / "run" / name).unlink()
    render(job, tmp_path / "run", Silence())
    assert (tmp_path / "run" / name).exists()
    assert RunFolder.read(tmp_path / "run").digest() == before


def test_a_nan_is_reported_with_its_file(tmp_path):
    """Not by its place in a clip."""
    job = toy_job(tmp_path, 2)
    render(job, tmp_path / "run", Silence())
    stem = tmp_path / "run" / "frames" / "0002"
    image = read_exr(stem.with_suffix(".exr"))
    image["RGB"][0, 0] = np.nan
    write_exr(stem.with_suffix(".exr"), image)
    with RunFolder.create(tmp_path / "run", job.identity()) as run:
        record = run.record_of([stem.with_suffix(".exr")])
        run.finish({"pass": "frames", "frame": 2, "files": record, "cost": {}})
        with pytest.raises(ImageError, match=r"frames/0002\.exr holds a NaN"):
            list(delivery.images_of(run, (1, 2)))
