"""``enfilade compare`` on images from a folder."""

import json
from typing import get_args

import av
import numpy as np
import pytest
from PIL import Image

from enfilade.cli.compare import command
from enfilade.comparison.compare import Mode
from enfilade.comparison.motion import FlowChoice
from enfilade.images import encode_video, open_sequence, write_exr
from enfilade.reports.heatmap import HeatmapPainter
from enfilade.settings import VideoSettings
from enfilade.viewing import DISPLAYS

KEYS = {  # docs/metric.md
    "score_jnd", "meaning", "steady_jnd", "transient_jnd", "percent_visible", "largest_jnd", "psnr_db",
    "worst_frame", "frames", "size", "fps", "pixels_per_degree", "distance_m", "peak_cd_m2", "black_cd_m2",
    "persistence", "mode", "flow", "bands_cpd", "scores", "per_frame", "is_identical", "noise_floor",
    "noise_estimate", "noise_note",
}  # fmt: skip
FRAME_KEYS = {
    "name", "number", "score_jnd", "steady_jnd", "transient_jnd", "percent_visible", "largest_jnd", "psnr_db",
    "steady_bands_jnd", "transient_bands_jnd", "velocity_deg_s", "is_identical",
}  # fmt: skip
FRAMES = 6


@pytest.fixture
def folders(tmp_path):
    """Still frames; every other one of the test is noisy in its left half."""
    rng = np.random.default_rng(1)
    for name, noise in (("test", 10), ("reference", 0)):
        (tmp_path / name).mkdir()
        for i in range(FRAMES):
            image = np.full((40, 60, 3), 120, np.int64)
            most = noise * (i % 2)
            image[:, :30] += rng.integers(-most, most + 1, (40, 30, 1))
            Image.fromarray(image.astype(np.uint8)).save(tmp_path / name / f"{i}.png")
    return tmp_path / "test", tmp_path / "reference"


def test_a_table_and_heat_maps_in_a_folder(run, folders, tmp_path):
    result = run("compare", *folders, "--mode", "paper", "--display", "paper", "--heatmap", tmp_path / "maps")
    assert result.exit_code == 0, result.output
    assert f"{FRAMES} frames, 60x40, 27.9 pixels per degree" in result.stdout
    assert "JND (strong overall; up to " in result.stdout
    assert "estimated from the reference" in result.stderr
    assert sorted(m.name for m in (tmp_path / "maps").iterdir()) == [f"{i}.png" for i in range(FRAMES)]
    with Image.open(tmp_path / "maps" / "1.png") as picture:
        noisy = np.asarray(picture.convert("RGB"), np.int64)
    assert noisy.shape[1] == 480  # enlarged eight times: the legend is legible
    colored = np.ptp(noisy[: 40 * 8], axis=2) > 60
    assert colored[:, : 25 * 8].mean() > 0.9
    assert colored[:, 55 * 8 :].mean() < 0.1


def test_further_measures_are_printed(run, folders):
    result = run("compare", *folders, "--flow", "none", "--measure", "psnr", "--measure", "flip")
    scores = json.loads(run("compare", *folders, "--flow", "none", "--measure", "psnr", "--json").stdout)[
        "scores"
    ]
    assert f"psnr {scores['psnr']:.4g} dB, flip 0." in result.stdout


def captions_of(monkeypatch):
    written = []
    monkeypatch.setattr(
        HeatmapPainter,
        "paint",
        lambda self, _jnd, _grey, text: written.append(text) or np.zeros((self.height, self.width, 3), "u1"),
    )
    return written


def test_frames_are_called_by_their_own_numbers(run, folders, tmp_path, monkeypatch):
    captions = captions_of(monkeypatch)
    for folder in folders:
        for i in reversed(range(FRAMES)):
            (folder / f"{i}.png").rename(folder / f"{i + 101}.png")
    result = run("compare", *folders, "--flow", "none", "--heatmap", tmp_path / "maps", "--json")
    numbers = list(range(101, 101 + FRAMES))
    assert [frame["number"] for frame in json.loads(result.stdout)["per_frame"]] == numbers
    assert [int(caption.split()[1]) for caption in captions] == numbers
    assert sorted(m.name for m in (tmp_path / "maps").iterdir()) == [f"{n}.png" for n in numbers]


def test_frames_of_a_video_are_counted_from_1(run, folders, tmp_path, monkeypatch):
    captions = captions_of(monkeypatch)
    frames = list(open_sequence(folders[0]))
    settings = VideoSettings(codec="ffv1")
    film = tmp_path / "film.mkv"
    encode_video(film, frames, fps=24.0, width=60, height=40, settings=settings, exposure_ev=0.0)
    result = run("compare", film, folders[1], "--flow", "none", "--heatmap", tmp_path / "maps", "--json")
    found = json.loads(result.stdout)["per_frame"]
    names = [(i, f"frame {i} of {film}") for i in range(1, FRAMES + 1)]
    assert [(frame["number"], frame["name"]) for frame in found] == names
    assert [int(caption.split()[1]) for caption in captions] == list(range(1, FRAMES + 1))
    assert sorted(m.name for m in (tmp_path / "maps").iterdir()) == [f"{i:06}.png" for i, _ in names]


@pytest.mark.parametrize("suffix", [".mp4", ".mkv"])
def test_heat_maps_as_a_video(run, folders, tmp_path, suffix):
    file = tmp_path / f"heat{suffix}"
    result = run(
        "compare", *folders, "--fps", "25", "--heatmap", file, "--graph", tmp_path / "new" / "graph.png"
    )
    assert result.exit_code == 0, result.output
    with av.open(str(file)) as container:
        stream = container.streams.video[0]
        assert sum(1 for _ in container.decode(stream)) == FRAMES
        assert stream.average_rate == 25
    with Image.open(tmp_path / "new" / "graph.png") as graph:
        assert graph.width > 800


def test_as_json(run, folders):
    result = run("compare", *folders, "--json", "--fps", "24", "--flow", "none", "--display", "phone")
    found = json.loads(result.stdout)
    assert set(found) == KEYS
    assert all(set(frame) == FRAME_KEYS for frame in found["per_frame"])
    assert (found["frames"], found["size"], found["fps"], found["flow"]) == (FRAMES, [60, 40], 24.0, "none")
    assert found["mode"] == "modern"
    assert found["peak_cd_m2"] == 450.0
    assert found["per_frame"][0]["score_jnd"] == 0.0
    assert found["per_frame"][1]["percent_visible"] > 0.0
    assert len(found["per_frame"][1]["steady_bands_jnd"]) == len(found["bands_cpd"])
    assert found["score_jnd"] > found["transient_jnd"] > 0.0


def test_both_modes(run, folders):
    for mode in ("paper", "modern"):
        found = json.loads(run("compare", *folders, "--json", "--quiet", "--mode", mode).stdout)
        assert found["mode"] == mode
        assert (found["transient_jnd"] > 0) == (mode == "modern")


def test_what_help_lists_is_what_there_is(run):
    # --help loads no NumPy, so it can't ask
    listed = {option.name: option.type for option in command.params}
    for name, known in (("mode", Mode), ("flow", FlowChoice)):
        assert tuple(listed[name].choices) == get_args(known)
    output = " ".join(run("compare", "--help").output.split())
    listed = run("compare", "--display", "list")
    assert listed.exit_code == 0
    for name, (_display, text) in DISPLAYS.items():
        assert name in output
        assert name in listed.stdout
        assert text in listed.stdout


def test_numbers_win_over_a_display(run, folders, tmp_path):
    def seen(*options):
        found = json.loads(run("compare", *folders, "--json", "--quiet", "--flow", "none", *options).stdout)
        return found["pixels_per_degree"], found["peak_cd_m2"]

    whole = seen("--display", "desktop-24-fhd")
    assert seen("--display", "desktop-24-fhd", "--set", "viewing.distance_m=1.2") == pytest.approx(
        (2.0 * whole[0], whole[1])
    )
    (tmp_path / "a.toml").write_text("[viewing]\npeak_cd_m2 = 80\n")
    options = ("--display", "desktop-24-fhd", "--settings", tmp_path / "a.toml")
    assert seen(*options) == pytest.approx((whole[0], 80.0))
    assert seen(*options, "--set", "viewing.peak_cd_m2=90") == pytest.approx((whole[0], 90.0))
    # Of an imported scene's settings, the tone curve does not count here.
    (tmp_path / "a.toml").write_text("[viewing]\npeak_cd_m2 = 80\nwhite = 8\n")
    assert seen(*options) == pytest.approx((whole[0], 80.0))


def test_layers_are_chosen_for_one_side_or_both(run, folders, tmp_path):
    values = {"albedo": 0.5, "beauty": 0.25}
    layers = {name: np.full((40, 60, 3), value, np.float32) for name, value in values.items()}
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        write_exr(tmp_path / folder / "0001.exr", layers)

    def score(*options):
        result = run("compare", tmp_path / "a", tmp_path / "b", "--json", *options)
        assert result.exit_code == 0, result.output
        return json.loads(result.stdout)["score_jnd"], result.stderr

    identical, said = score()
    assert identical == 0.0
    assert "the layer beauty of " in said
    assert "--layer chooses another: albedo" in said
    assert score("--layer", "albedo")[0] == 0.0
    assert score("--layer", "albedo", "--layer", "beauty")[0] > 1.0
    refused = run("compare", tmp_path / "a", tmp_path / "b", "--layer", "diffuse")
    assert refused.exit_code == 2
    assert "no colour layer diffuse; it has the colour layers albedo, beauty" in refused.stderr
    refused = run("compare", *folders, "--layer", "albedo")
    assert refused.exit_code == 2
    assert "leave out --layer" in refused.stderr


def test_viewing_conditions_count(run, folders):
    near, far = (
        json.loads(run("compare", *folders, "--json", "--set", f"viewing.distance_m={d}").stdout)["score_jnd"]
        for d in ("0.5", "50")
    )
    assert far < 0.9 * near


@pytest.mark.parametrize("what", ["gone", "empty"])
def test_nothing_to_compare_is_wrong_input(run, folders, tmp_path, what):
    (tmp_path / "empty").mkdir()
    result = run("compare", tmp_path / what, folders[1])
    assert result.exit_code == 2
    assert what in result.stderr


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--display", "imax"), "unknown display 'imax'; known are: paper"),
        (("--heatmap", "heat.gif"), "give a folder, or a file .mp4"),
        (("--graph", "graph.pdf"), "give a file name that ends in .png"),
        (("--fps", "0"), "fps"),
        (("--layer", "a", "--layer", "b", "--layer", "c"), "--layer is given 3 times"),
    ],
)
def test_wrong_options_are_refused_before_anything_is_compared(run, folders, options, message):
    result = run("compare", *folders, *options)
    assert result.exit_code == 2
    assert message in result.stderr
    assert "to do" not in result.stderr


@pytest.mark.parametrize("target", ["heat.mp4", "maps"])
def test_nothing_unfinished_stands_under_a_final_name(run, folders, tmp_path, target):
    broken = folders[0] / "3.png"
    broken.write_bytes(broken.read_bytes()[:60])
    out = tmp_path / "out"
    result = run("compare", *folders, "--heatmap", out / target, "--graph", out / "graph.png")
    assert result.exit_code == 2
    assert "test/3.png" in result.stderr
    finished = {"0.png", "1.png"} if target == "maps" else set()
    assert {f.name for f in out.rglob("*") if f.is_file()} == finished


@pytest.mark.parametrize(("transfer", "name"), [("smpte2084", "PQ"), ("arib-std-b67", "HLG")])
def test_hdr_video_is_refused(run, folders, tmp_path, transfer, name):
    # As cameras and streaming services have it: HEVC of 10 bits, BT.2020, the transfer in its own headers.
    file = tmp_path / "hdr.mp4"
    tags = f"colorprim=bt2020:transfer={transfer}:colormatrix=bt2020nc:log-level=error"
    tags += ":frame-threads=1:pools=none:bframes=0"  # the same packets on a busy machine
    with av.open(file, "w") as container:
        stream = container.add_stream("libx265", rate=30, options={"x265-params": tags})
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p10le"
        for index in range(2):
            picture = av.VideoFrame(64, 48, "yuv420p10le")
            picture.pts = index
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))
    result = run("compare", file, folders[1])
    assert result.exit_code != 0
    assert "hdr.mp4" in result.stderr
    assert name in result.stderr
    assert "convert" in result.stderr


def contents(folder):
    return {file: file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def test_what_is_compared_is_not_written_over(run, folders, tmp_path):
    film, size = tmp_path / "film.mkv", {"width": 60, "height": 40}
    frames = list(open_sequence(folders[0]))
    encode_video(film, frames, fps=24.0, settings=VideoSettings(codec="ffv1"), exposure_ev=0.0, **size)
    (tmp_path / "counted").mkdir()
    for i in range(FRAMES):
        (tmp_path / "counted" / f"{i + 1:06}.png").write_bytes((folders[1] / f"{i}.png").read_bytes())
    (tmp_path / "link").symlink_to(folders[1])
    before = contents(tmp_path)
    for test, reference, flag, target in (
        (*folders, "--heatmap", folders[0]),
        (*folders, "--heatmap", tmp_path / "link"),
        (folders[0] / "%d.png", folders[1], "--heatmap", folders[0]),
        (film, folders[1], "--heatmap", film),
        (film, tmp_path / "counted", "--heatmap", tmp_path / "counted"),
        (*folders, "--graph", folders[1] / "3.png"),
    ):
        refused = run("compare", test, reference, flag, target)
        assert refused.exit_code == 2, refused.output
        assert f"{flag} would replace {target}" in refused.stderr
        assert "is compared" in refused.stderr
        assert "to do" not in refused.stderr
    assert contents(tmp_path) == before


def test_other_images_may_stand_beside_heat_maps(run, folders, tmp_path):
    for folder in folders:
        for i in range(2, FRAMES):
            (folder / f"{i}.png").unlink()
    film = tmp_path / "film.mkv"
    frames = list(open_sequence(folders[0]))
    settings = VideoSettings(codec="ffv1")
    encode_video(film, frames, fps=24.0, width=60, height=40, settings=settings, exposure_ev=0.0)
    before = contents(folders[1])
    result = run("compare", film, folders[1], "--flow", "none", "--heatmap", folders[1])
    assert result.exit_code == 0, result.output
    assert before.items() < contents(folders[1]).items()
