"""The case studies on small analytic scenes: what each item measures."""

import dataclasses

import numpy as np
import pytest

from enfilade.camera.path import Segment
from enfilade.gbuffer import find_geometry, image_flow
from enfilade.methods.keyframes import place_keyframes
from enfilade.monitor import Silence
from enfilade.pipeline.cost import Costs
from enfilade.pipeline.plan import hole_percent
from enfilade.pipeline.survey import survey_path
from enfilade.pipeline.views import Views
from enfilade.records import SurfaceClass
from enfilade.renderer import PixelFilter, Purpose, RandomKey
from enfilade.settings import AntialiasSettings, KeyframeSettings, Placement, Settings
from scenes_analytic import room, room_walk
from small_runs import job_of
from studies.cases import placement, reflections, separation, shares, statistics, supports, threshold
from studies.cases import times as table2
from studies.cases.filtering import antialiased
from studies.cases.mirrored import VIRTUAL, mirror_pixels, mirrored
from studies.cases.plain import PlainlyLit
from studies.cases.seen import Viewer, score_in, visible_percent
from studies.cases.speed import mean_cost, spread_over
from studies.cases.windows import Windows, probes_of


def windows_of(folder, *, specular=False, count=24, is_plain=True, **tables):
    job = job_of(folder, room(specular=specular), room_walk(count, size=(64, 48)), **tables)
    renderer = job.open_renderer()
    views = Views(renderer, job.path, job.viewing, Costs())
    survey = survey_path(views, job.path, job.settings, Silence())
    source = PlainlyLit(renderer) if is_plain else renderer
    return Windows(job, source, survey, None if is_plain else folder / "kept", Silence(), views, 64)


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return windows_of(tmp_path_factory.mktemp("plain"))


@pytest.fixture(scope="module")
def shiny(tmp_path_factory):
    return windows_of(tmp_path_factory.mktemp("shiny"), specular=True)


# --- what is common


def test_plain_light_has_no_noise_and_paths_through_a_pixel_antialias(plain):
    camera = plain.job.path.cameras[3]
    pixels = np.arange(64 * 48, dtype=np.uint32)

    def trace(seed, pixel_filter, spp=4):
        return plain.renderer.trace(
            camera, pixels, RandomKey(seed, 1, Purpose.FILL), spp=spp, pixel_filter=pixel_filter
        )

    centre = trace(0, PixelFilter.CENTRE)
    np.testing.assert_array_equal(centre.color, trace(1, PixelFilter.CENTRE).color)
    assert not centre.variance.any()
    box = trace(0, PixelFilter.BOX, 64)
    assert (box.variance > 0.0).mean() > 0.02
    # inside a smooth surface both agree
    flat = box.variance < 1e-9
    np.testing.assert_allclose(centre.color[flat], box.color[flat], atol=0.02)


def test_plain_light_shows_what_mirrors_reflect(shiny):
    geometry = shiny.geometry(5)
    seen = mirrored(shiny.renderer, geometry)
    mirror = mirror_pixels(geometry)
    assert mirror.any()
    assert ((seen.shape_index[mirror] >= VIRTUAL) | (seen.shape_index[mirror] == 0)).all()
    np.testing.assert_array_equal(seen.shape_index[~mirror], geometry.shape_index[~mirror])
    color = shiny.traced(5).color
    hit = mirror & (seen.shape_index > VIRTUAL)
    wanted = seen.albedo[hit] * (0.3 + 0.7 * np.abs(seen.normal[hit] @ np.array([0.36, 0.48, 0.8])))[:, None]
    is_plain = np.isin(seen.surface[hit], [SurfaceClass.DIFFUSE, SurfaceClass.GLOSSY])
    np.testing.assert_allclose(color[hit][is_plain], wanted[is_plain], atol=2e-3)


def test_the_virtual_image_of_a_plane_mirror_stands_still(tmp_path):
    """A mirror as back wall: the reflected room is a room behind it, whose flow is that of its points."""
    from enfilade.camera.pinhole import Camera, look_at
    from support.analytic_scene import AnalyticScene, Checker, Material, Quad

    mirror = Material((0.9, 0.9, 0.9), SurfaceClass.MIRROR)
    checks = Material(Checker((0.8, 0.8, 0.8), (0.2, 0.2, 0.2), 0.5))
    glass = Quad((-9, -9, 0), (18, 0, 0), (0, 18, 0), mirror, "mirror")  # z = 0
    wall = Quad((-20, -20, 5), (0, 40, 0), (40, 0, 0), checks, "wall")  # z = 5, behind the camera
    scene = AnalyticScene((glass, wall))
    virtual = AnalyticScene((Quad((-20, -20, -5), (40, 0, 0), (0, 40, 0), checks, "wall"),))
    cameras = [Camera(look_at((0.1 * k, 0, 3), (0.1 * k + 0.3, 0.1, 0)), 50.0, 32, 24) for k in range(2)]

    def geometry_of(of, name):
        folder = tmp_path / name
        folder.mkdir()
        job = job_of(folder, of, room_walk(2, size=(32, 24)))
        renderer = job.open_renderer()
        return renderer, find_geometry(renderer, cameras[0])

    renderer, geometry = geometry_of(scene, "real")
    _, wanted = geometry_of(virtual, "virtual")
    seen = mirrored(renderer, geometry)
    np.testing.assert_allclose(
        seen.depth, wanted.depth, rtol=2e-3
    )  # the ray begins a little before the mirror
    flow, truth = (image_flow(g, None, cameras[1]).forward for g in (seen, wanted))
    np.testing.assert_allclose(flow, truth, atol=0.01)
    assert np.abs(flow - image_flow(geometry, None, cameras[1]).forward).max() > 0.3


def test_probes_go_from_slow_to_fast_and_are_told_once(plain):
    probes = probes_of(plain.survey, len(plain.job.path), 4)
    speeds = [plain.survey.speed_deg_s[f] for f in probes]
    assert speeds == sorted(speeds)
    assert len(set(probes)) == len(probes)
    assert probes_of(plain.survey, len(plain.job.path), 100) == probes_of(
        plain.survey, len(plain.job.path), 99
    )


def test_a_keyframe_is_reused_as_it_was_traced(plain):
    np.testing.assert_array_equal(plain.reused(0).color, plain.traced(0).color)
    between = plain.reused(3)
    assert 0.0 < np.abs(between.color - plain.traced(3).color).mean() < 0.05


def test_traced_frames_are_kept_and_read_again(tmp_path):
    windows = windows_of(tmp_path, is_plain=False, count=8)
    first = windows.traced(2)
    again = windows_of(tmp_path, is_plain=False, count=8)
    np.testing.assert_array_equal(again.traced(2).color, first.color)
    assert len(list((tmp_path / "kept").rglob("*.exr"))) == 1
    assert windows.reused(2).variance.max() > 0.0


def test_scores_of_parts_of_a_map():
    jnd = np.array([[0.5, 2.0], [2.0, 4.0]], np.float32)
    everywhere, nowhere = np.ones((2, 2), bool), np.zeros((2, 2), bool)
    assert visible_percent(jnd, everywhere) == 75.0
    assert score_in(jnd, jnd == 2.0) == pytest.approx(2.0)
    assert 2.0 < score_in(jnd, everywhere) < 4.0
    assert score_in(jnd, nowhere) is None
    assert visible_percent(jnd, nowhere) is None


def test_noise_that_is_declared_does_not_count(plain):
    viewer = Viewer(plain.job.viewing, plain.job.settings)
    reference = plain.traced(5).color
    noise = np.random.default_rng(1).normal(0.0, 0.05, reference.shape[:2]).astype(np.float32)
    test = np.maximum(reference + noise[..., None], 0.0)
    blind = viewer.paper(test, reference, None)
    told = viewer.paper(test, reference, None, noise=np.full(noise.shape, 0.05**2, np.float32))
    assert (blind > 1.0).mean() > 0.3
    assert (told > 1.0).mean() < 0.05


def test_a_viewer_takes_the_slope_of_masking_from_the_settings(plain):
    reference = plain.traced(5).color
    noise = np.random.default_rng(1).normal(0.0, 0.05, reference.shape).astype(np.float32)

    def seen(slope):
        settings = Settings.from_tables({"metric": {"mask_slope": slope}})
        return Viewer(plain.job.viewing, settings).paper(reference + noise, reference, None).mean()

    assert seen(1.0) < 0.95 * seen(0.0)


# --- 1: placement


def test_holes_are_those_of_the_pipeline_and_an_even_split_has_as_many_keyframes(plain):
    job, uniform = plain.job, KeyframeSettings(placement=Placement.UNIFORM, spacing=6)
    row = placement.recomputed(job, plain.views, plain.survey, uniform, 1, Silence())
    assert row["keyframes"] == [1, 7, 13, 19, 24]
    assert row["adaptation"] is None
    wanted = hole_percent(job, plain.views, Segment(0, 6), 3)
    assert row["percent"][row["frames"].index(4)] == wanted
    assert row["mean"] == pytest.approx(sum(row["percent"]) / 24)
    even = dataclasses.replace(uniform, placement=Placement.EQUAL_FLOW)
    assert len(place_keyframes(np.ones(24), even)) == 5


def test_frames_that_are_left_out_are_stood_for_by_their_neighbours(plain):
    uniform = KeyframeSettings(placement=Placement.UNIFORM, spacing=6)
    every = placement.recomputed(plain.job, plain.views, plain.survey, uniform, 1, Silence())
    some = placement.recomputed(plain.job, plain.views, plain.survey, uniform, 2, Silence())
    assert len(some["frames"]) < len(every["frames"])
    assert some["mean"] == pytest.approx(every["mean"], rel=0.25)


# --- 2: predictions


def row(first, last, depth, percent, still, *, is_split, middle=1):
    return {
        "first": first, "last": last, "middle": middle, "depth": depth, "percent_visible": percent,
        "percent_visible_no_pursuit": still, "is_split": is_split,
    }  # fmt: skip


def test_predictions_by_hand():
    segments = [
        row(0, 10, 0, 20.0, 8.0, is_split=True),
        row(0, 4, 1, 4.0, 2.0, is_split=False),
        row(4, 10, 1, 12.0, 11.0, is_split=False),  # splitting helped no more
        row(10, 14, 0, 2.0, 1.0, is_split=False),
        row(14, 15, 0, 0.0, 0.0, is_split=False, middle=None),  # nothing between its keyframes
    ]
    found = statistics.predictions(segments, 10.0)
    assert (found["initial"], found["split"], found["remaining"]) == (2, 1, 3)
    assert found["before"] == pytest.approx((9 * 20.0 + 3 * 2.0) / 12)
    assert found["after"] == pytest.approx((3 * 4.0 + 5 * 12.0 + 3 * 2.0) / 11)
    assert (found["split_before"], found["split_after"]) == (20.0, (3 * 4.0 + 5 * 12.0) / 8)
    assert found["before_still"] == pytest.approx((9 * 8.0 + 3 * 1.0) / 12)
    assert found["after_still"] == pytest.approx((3 * 2.0 + 5 * 11.0 + 3 * 1.0) / 11)
    assert found["split_not_seen_still"] == 1
    assert found["seen_still_not_split"] == 1
    assert found["given_up"] == 1
    assert statistics.predictions(segments[3:], 10.0)["split_before"] is None


# --- 4: times


def test_art_is_the_least_number_of_paths_at_which_nothing_is_seen():
    def said(*percents):
        return [{"score": 0.0, "visible_percent": p} for p in percents]

    assert table2.art_spp({4: said(20.0, 1.0), 8: said(0.5, 1.2), 16: said(0.9, 1.0)}) == (16, False)
    assert table2.art_spp({4: said(20.0), 8: said(3.0)}) == (8, True)


def test_equal_quality_is_read_off_the_series():
    series = [{"spp": n, "frames": [{"score": 40.0 / n}, {"score": 80.0 / n}]} for n in (4, 8, 16)]  # 60 / n
    assert table2.equal_spp(series, 7.5) == pytest.approx(8.0)
    assert table2.equal_spp(series, 60.0 / 11.0) == pytest.approx(11.0)
    assert table2.equal_spp(series, 2.0) is None
    assert table2.equal_spp(series, 99.0) is None


def test_the_paper_s_ratios():
    of = table2.PAPER_MINUTES
    assert of["atrium"]["art"] / of["atrium"]["ibr_rt"] == pytest.approx(8.3, abs=0.05)
    assert of["room"]["rt"] / of["room"]["ibr_rt"] == pytest.approx(1.36, abs=0.01)
    assert all(
        sum(v for k, v in t.items() if k != "total") == pytest.approx(t["total"])
        for t in shares.PAPER.values()
    )


def test_judged_frames_are_spread_over_the_walk():
    assert spread_over(200, 4) == [25, 75, 124, 174]
    assert spread_over(3, 1) == [1]


def test_the_speed_of_other_hours_is_averaged():
    slow, fast = ({name: {"wall": s, "cpu": 2.0 * s} for name in ("centre", "gaussian")} for s in (3.0, 1.0))
    assert mean_cost([slow, fast])["gaussian"] == {"wall": 2.0, "cpu": 4.0}


# --- 5: velocity threshold


def test_all_traced_is_no_difference_and_nothing_traced_is_all_of_it(plain):
    terms = threshold.Calibration(thresholds_deg_s=(0.0, 1.0, 1000.0))
    found = threshold.calibrate(plain, [8, 12], terms)
    low, _, high = found["curve"]
    assert low["traced_percent"] == 0.0
    assert low["removed_below_deg_s"] is None  # I_c is I_ibr
    assert low["reused_visible_percent"] > 0.0
    assert high["traced_percent"] == 100.0
    assert high["reused_visible_percent"] is None  # nothing is reused
    assert high["removed_below_deg_s"] > 0.0
    seen = sum(r["visible_percent"] * r["pixels"] for r in found["by_velocity"]) / 100.0
    assert seen <= low["reused_visible_percent"] / 100.0 * 2 * 64 * 48 + 1.0


def test_the_threshold_is_the_least_from_which_on_little_is_seen():
    def curve(*percents):
        return [{"threshold_deg_s": float(k), "reused_visible_percent": p} for k, p in enumerate(percents)]

    assert threshold.chosen(curve(30.0, 5.0, 0.5, 0.2), 1.0) == 2.0
    assert threshold.chosen(curve(0.5, 5.0, 0.5, None), 1.0) == 2.0  # what comes back counts
    assert threshold.chosen(curve(0.1, 0.1), 1.0) == 0.0
    assert threshold.chosen(curve(9.0, 5.0), 1.0) is None
    assert threshold.chosen(curve(9.0, 5.0, None), 1.0) is None  # all is traced: that is no threshold


def test_slow_pixels_are_traced_and_the_others_reused():
    rt, ibr = np.ones((2, 2, 3), np.float32), np.zeros((2, 2, 3), np.float32)
    is_slow = np.array([[True, False], [False, True]])
    np.testing.assert_array_equal(threshold.composed(rt, ibr, is_slow)[..., 0], is_slow)


# --- 6: supports


def test_uniform_supports_are_uniform(plain):
    one = supports.uniform(1.0, 1)
    np.testing.assert_allclose(
        antialiased(plain, 8, lambda f: plain.traced(f).color, one), plain.traced(8).color, atol=1e-6
    )
    wide = antialiased(plain, 8, lambda f: plain.traced(f).color, supports.uniform(11.0, 1))
    assert np.abs(np.diff(wide, axis=1)).mean() < 0.7 * np.abs(np.diff(plain.traced(8).color, axis=1)).mean()


def test_a_little_filter_is_better_than_none_and_a_wide_one_is_worse(plain):
    terms = supports.Supports(spatial_px=(1.0, 3.0, 11.0), temporal=(1, 11), edges_deg_s=(0.0, 1.0))
    found = supports.measure(plain, [8, 14], terms)
    assert found["classes"]
    for velocity in found["classes"]:
        scores = np.array(velocity["scores"]["paper"])
        assert scores.shape == (3, 2)
        assert scores[1, 1] < scores[0, 0]
        assert scores[2, 1] > scores[1, 1]
        assert velocity["best"]["paper"]["score"] == scores.min()


# --- 7 and 8: separation, reflections


def test_ghosts_are_away_from_outlines_and_antialiasing_is_at_them(tmp_path):
    plain = windows_of(tmp_path, count=10)  # fast: the ball moves before the wall by a pixel a frame
    found, example = separation.measure(plain, [4, 5])
    assert {r["frame"] for r in found["frames"]} == {5, 6}
    most = max(found["frames"], key=lambda r: r["ghosts"]["pixels"])
    assert found["example"] == most["frame"]
    assert 0.0 < most["ghosts"]["pixels"] < 20.0
    near = separation.outlines(plain.geometry(most["frame"] - 1).shape_index)
    viewer = Viewer(plain.job.viewing, plain.job.settings)
    changed = separation.changed_pixels(viewer, example["together"], example["apart"])
    wanted = viewer.shown(example["reference"])
    shown = [np.abs(viewer.shown(example[name]) - wanted) for name in ("together", "apart")]
    ghosts = changed & ~near & (shown[0] > shown[1])
    np.testing.assert_array_equal(example["ghost"] > 0.0, ghosts)
    assert most["ghosts"]["count"] == ghosts.sum()
    assert most["outlines"]["pixels"] == pytest.approx(100.0 * (changed & near).mean())
    effect = {where: most[where]["effect"]["motion"]["score"] for where in ("ghosts", "outlines")}
    assert effect["ghosts"] == pytest.approx(score_in(example["motion"], ghosts))
    assert min(effect.values()) > score_in(example["motion"], ~changed)


def test_outlines_by_hand():
    shape_index = np.ones((9, 9), np.uint32)
    shape_index[:, 5:] = 2
    assert separation.outlines(shape_index)[4].tolist() == [False] * 3 + [True] * 4 + [False] * 2


def test_the_flow_of_the_reflection_keeps_what_the_mirror_shows(tmp_path):
    """Along a plane mirror: its own flow blurs the reflection, that of the virtual image does not."""
    from support.analytic_scene import AnalyticScene, Checker, Material, Quad

    mirror = Material((0.9, 0.9, 0.9), SurfaceClass.MIRROR)
    checks = Material(Checker((0.9, 0.9, 0.9), (0.1, 0.1, 0.1), 2.4))
    back = Quad((-3, 0, -1), (6, 0, 0), (0, 3, 0), mirror, "mirror")
    front = Quad((-20, -10, 8), (0, 20, 0), (40, 0, 0), checks, "wall")
    job = job_of(tmp_path, AnalyticScene((back, front)), room_walk(24, size=(64, 48), turn_deg=0.0))
    renderer = job.open_renderer()
    views = Views(renderer, job.path, job.viewing, Costs())
    survey = survey_path(views, job.path, job.settings, Silence())
    windows = Windows(job, PlainlyLit(renderer), survey, None, Silence(), views, 64)
    probes = reflections.most_mirrors(windows, 1)
    found, example = reflections.measure(windows, probes)
    by = {name: of["motion"]["score"] for name, of in found["frames"][0]["filters"].items()}
    assert by["reflected"] < by["full"]
    assert by["reflected"] < by["none"]
    assert set(example) == {"none", "full", "short", "reflected", "reference", "mirror"}


def test_a_room_without_mirrors_has_no_frame_to_show_one(plain):
    assert reflections.most_mirrors(plain, 3) == []


def test_crops_are_cut_from_the_middle(tmp_path):
    job = job_of(tmp_path, room(), room_walk(4, size=(64, 48)))
    crop = table2.Crop.of(job, (10, 8))
    assert crop.size == (8, 10)
    image = np.arange(64 * 48).reshape(48, 64)
    np.testing.assert_array_equal(crop.cut(image).ravel(), crop.pixels(job))
    assert image[24, 32] in crop.cut(image)
    assert table2.Crop.of(job, (999, 999)).size == (48, 64)


def test_still_settings_are_the_paper_s():
    assert threshold.PAPER_DEG_S == 0.5
    assert (AntialiasSettings().frames, AntialiasSettings().slow_frames) == (11, 15)
