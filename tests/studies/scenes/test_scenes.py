"""The generated scenes: their files, and the cases that §6 needs."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import mitsuba as mi
import numpy as np
import pytest
from scene_views import View, folder_bytes, read_path

from enfilade.camera import load_path
from enfilade.errors import InputError, SettingsError
from enfilade.scene.mitsuba.emitters import partly_sampled
from enfilade.scene.mitsuba.load import load_scene
from enfilade.scene.mitsuba.merge import merge_meshes
from studies.scenes import PRESETS, SCENES, SceneFiles, write_scene
from studies.scenes import courtyard_plan as courtyard
from studies.scenes import gallery_plan as gallery
from studies.scenes.atrium import walk as atrium_walk
from studies.scenes.courtyard import walk as courtyard_walk
from studies.scenes.gallery import walk as gallery_walk
from studies.scenes.kitchen import walk as kitchen_walk
from studies.scenes.presets import PRESETS as SIZES
from studies.scenes.room import walk as room_walk

Look = Callable[[str, int], View]


def test_import_loads_nothing_heavy() -> None:
    heavy = ("mitsuba", "drjit", "matplotlib", "trimesh", "scipy", "PIL")
    code = f"import sys, studies.scenes; print([m for m in {heavy!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)  # noqa: S603
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("name", SCENES)
def test_same_call_writes_same_bytes(name: str, small: dict[str, SceneFiles], tmp_path: Path) -> None:
    again = write_scene(name, tmp_path / "again", preset="small")
    assert folder_bytes(again.scene.parent) == folder_bytes(small[name].scene.parent)


def test_another_size_shows_more_to_the_sides(small: dict[str, SceneFiles], tmp_path: Path) -> None:
    wide = write_scene("room", tmp_path / "wide", preset="small", size=(64, 36))
    path, usual = load_path(wide.path), load_path(small["room"].path)
    assert (path.width, path.height) == (64, 36)
    assert path.cameras[0].fov_deg == usual.cameras[0].fov_deg
    film = ET.parse(wide.scene).getroot().find("sensor/film")
    assert film is not None
    assert [e.get("value") for e in film.iter("integer")] == ["64", "36"]


@pytest.mark.parametrize("name", SCENES)
def test_references_resolve_within_the_folder(name: str, small: dict[str, SceneFiles]) -> None:
    root = ET.parse(small[name].scene).getroot()
    assert root.get("version") == "3.0.0"
    files = [Path(str(e.get("value"))) for e in root.iter("string") if e.get("name") == "filename"]
    assert files
    for file in files:
        assert not file.is_absolute()
        assert ".." not in file.parts
        assert (small[name].scene.parent / file).is_file()
    names = [e.get("id") for e in root if e.get("id")]
    assert len(names) == len(set(names))
    assert {e.get("id") for e in root.iter("ref")} <= set(names)
    if name == "room":
        assert {e.get("type") for e in root.iter("bsdf")} == {"twosided", "diffuse"}


@pytest.mark.parametrize("name", SCENES)
def test_emitters_are_sampled_whole(
    name: str, small: dict[str, SceneFiles], loaded: Callable[[str], Any]
) -> None:
    loaded(name)  # chooses the variant
    assert partly_sampled(merge_meshes(load_scene(small[name].scene))) == []


@pytest.mark.parametrize("name", SCENES)
def test_loads_and_renders_with_sensible_exposure(name: str, loaded: Callable[[str], Any]) -> None:
    image = np.array(mi.render(loaded(name), spp=8, seed=1))[..., :3]
    assert image.shape == (240, 320, 3)
    assert np.isfinite(image).all()
    shown = np.clip(image, 0.0, 1.0) ** (1 / 2.2)
    assert 0.25 < shown.mean() < 0.65
    assert (image.mean(axis=-1) > 1.0).mean() < 0.2


@pytest.mark.parametrize("name", SCENES)
def test_path_is_rigid_and_complete(name: str, small: dict[str, SceneFiles]) -> None:
    document, poses = read_path(small[name])
    assert document["camera_type"] == "perspective"
    assert (document["render_width"], document["render_height"], document["fps"]) == (320, 240, 30)
    assert document["seconds"] == len(poses) / 30
    turns = poses[:, :3, :3]
    identity = np.broadcast_to(np.eye(3), turns.shape)
    np.testing.assert_allclose(turns @ turns.transpose(0, 2, 1), identity, atol=1e-7)
    np.testing.assert_allclose(np.linalg.det(turns), 1.0, atol=1e-7)
    np.testing.assert_array_equal(poses[:, 3], np.tile([0.0, 0.0, 0.0, 1.0], (len(poses), 1)))
    assert (turns[:, 2, 1] > 0.9).all()  # the camera stays upright


@pytest.mark.parametrize(
    ("design", "counts"),
    [
        (room_walk, (448, 60)),
        (atrium_walk, (200, 60)),
        (gallery_walk, (300, 60)),
        (kitchen_walk, (300, 60)),
        (courtyard_walk, (300, 60)),
    ],
)
def test_walks_have_their_length_and_no_jerks(design: Callable[..., Any], counts: tuple[int, ...]) -> None:
    assert tuple(design(SIZES[preset])[1] for preset in PRESETS) == counts
    walk, frames = design(SIZES["full"])
    poses = walk.poses(frames)
    step = np.diff(poses[:, :3, 3], axis=0)
    # A 30th of a second changes the velocity by less than 5 mm a frame: 4.5 m/s².
    assert np.linalg.norm(np.diff(step, axis=0), axis=1).max() < 0.005
    cosines = np.einsum("nij,nij->n", poses[1:, :3, :3], poses[:-1, :3, :3]) / 2 - 0.5
    turn_deg = np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))
    assert np.abs(np.diff(turn_deg)).max() < 0.5


def test_room_rests_and_hurries(look: Look) -> None:
    rest, start = look("room", 4), look("room", 12)
    assert (rest.speed_deg_s < 0.5).mean() > 0.9
    assert (start.speed_deg_s < 0.5).mean() > 0.7
    assert rest.speed_deg_s.mean() > 0.02  # it drifts, it does not stand still
    assert look("room", 45).speed_deg_s.mean() > 5.0


def test_atrium_is_view_dependent_for_two_fifths_and_moves_steadily(look: Look) -> None:
    views = [look("atrium", frame) for frame in (0, 12, 24, 36, 48, 58)]
    shares = [view.is_view_dependent.mean() for view in views]
    assert 0.35 < np.mean(shares) < 0.45
    assert min(shares) > 0.2
    assert all((view.speed_deg_s < 0.5).mean() < 0.1 for view in views)


@pytest.mark.parametrize("name", SCENES)
def test_camera_keeps_clear_and_indoors(name: str, look: Look) -> None:
    for frame in range(0, 59, 6):
        distance = look(name, frame).distance
        assert distance.min() > 0.3
        if name not in ("gallery", "courtyard"):
            assert np.isfinite(distance).all()  # no ray leaves through a gap


def test_rays_leave_the_gallery_by_its_windows(look: Look) -> None:
    windows = [(x, gallery.WINDOW_WIDTH, gallery.SILL, gallery.HEAD) for x in gallery.WINDOWS_X]
    east = [(gallery.EAST_WINDOW, gallery.EAST_WIDTH, gallery.EAST_SILL, gallery.EAST_HEAD)]
    counts = []
    for frame in range(0, 59, 6):
        view = look("gallery", frame)
        out = view.rays[np.isinf(view.distance)]
        counts.append(len(out))
        by_south = _crossing(view.eye, out, axis=1, plane=0.0)
        by_east = _crossing(view.eye, out, axis=0, plane=gallery.LENGTH)
        assert (_within(by_south[:, [0, 2]], windows) | _within(by_east[:, [1, 2]], east)).all()
    assert max(counts) > 30  # the sky is in view


@pytest.mark.parametrize(
    ("start", "end"),
    [((2.6, 1.9, 0.001), (2.6, 3.1, 0.001)), ((4.4, 6.999, 0.4), (4.4, 6.999, 1.6))],
    ids=["floor near the blind", "wall far from the blind"],
)
def test_blinds_throw_stripes_near_and_far(
    start: tuple[float, ...], end: tuple[float, ...], loaded: Callable[[str], Any]
) -> None:
    points = np.linspace(start, end, 2000)
    towards = mi.Vector3f((-np.array(gallery.SUN) / np.linalg.norm(gallery.SUN)).tolist())
    is_shaded = np.array(
        loaded("gallery").ray_test(mi.Ray3f(mi.Point3f(points.T.astype(np.float32)), towards))
    )
    assert 0.25 < is_shaded.mean() < 0.75
    assert np.count_nonzero(np.diff(is_shaded.astype(int))) > 6  # at least three stripes


def test_kitchen_has_small_lamps_and_layered_materials(small: dict[str, SceneFiles]) -> None:
    root = ET.parse(small["kitchen"].scene).getroot()
    assert {e.get("type") for e in root.iter("emitter")} == {"area", "spot"}
    layered = {"principled", "roughplastic", "plastic", "roughconductor", "conductor", "dielectric"}
    assert layered <= {e.get("type") for e in root.iter("bsdf")}


def test_the_sky_is_seen_above_the_courtyard_only(look: Look) -> None:
    views = [look("courtyard", frame) for frame in range(0, 59, 6)]
    low, high = np.array(courtyard.COURT)
    for view in views:
        out = view.rays[np.isinf(view.distance)]
        above = _crossing(view.eye, out, axis=2, plane=courtyard.PARAPET)[:, :2]  # NaN where it points down
        assert ((above > low - 0.3) & (above < high + 0.3)).all()
    assert max(np.isinf(view.distance).mean() for view in views) > 0.02


def test_half_of_the_court_is_in_the_sun(loaded: Callable[[str], Any]) -> None:
    (x0, y0), (x1, y1) = courtyard.COURT
    x, y = np.meshgrid(np.linspace(x0, x1, 60), np.linspace(y0, y1, 60))
    points = np.stack([x, y, np.full_like(x, -0.119)], axis=-1).reshape(-1, 3)
    towards = mi.Vector3f((-np.array(courtyard.SUN) / np.linalg.norm(courtyard.SUN)).tolist())
    rays = mi.Ray3f(mi.Point3f(points.T.astype(np.float32)), towards)
    assert 0.3 < np.array(loaded("courtyard").ray_test(rays)).mean() < 0.8


@pytest.mark.parametrize("design", [gallery_walk, kitchen_walk])
@pytest.mark.parametrize("preset", PRESETS)
def test_new_walks_rest_and_keep_a_walking_pace(design: Callable[..., Any], preset: str) -> None:
    walk, frames = design(SIZES[preset])
    step_m = np.linalg.norm(np.diff(walk.poses(frames)[:, :3, 3], axis=0), axis=1)
    assert 30 * step_m.max() < 2.0  # m/s
    assert 30 * step_m.min() < 0.1


def _crossing(eye: np.ndarray, rays: np.ndarray, *, axis: int, plane: float) -> np.ndarray:
    """Where rays meet the plane of an inner face of a wall, (n, 3); NaN behind the eye."""
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (plane - eye[axis]) / rays[:, axis]
    return eye + rays * np.where(along > 0.0, along, np.nan)[:, None]


def _within(points: np.ndarray, windows: list[tuple[float, float, float, float]]) -> np.ndarray:
    """Whether points (along, z) are within one of the openings (centre, width, sill, head)."""
    along, z = points.T
    inside = [(abs(along - c) <= w / 2) & (z >= low) & (z <= high) for c, w, low, high in windows]
    return np.any(inside, axis=0)


def test_unknown_names_and_sizes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="no image of 0x9 pixels"):
        write_scene("room", tmp_path, size=(0, 9))
    with pytest.raises(InputError, match="room, atrium"):
        write_scene("cellar", tmp_path)
    with pytest.raises(InputError, match="full, small"):
        write_scene("room", tmp_path, preset="huge")
