"""The Mitsuba backend: traced pixels against Mitsuba's own renderer, kernels, scenes that are refused."""

import gc
import math
import re
import subprocess
import sys

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from enfilade.arrays import ALIGNMENT, Array3f, Bool, Float, UInt
from enfilade.camera.pinhole import Camera, look_at
from enfilade.errors import SceneError
from enfilade.gbuffer import find_geometry
from enfilade.records import SurfaceClass
from enfilade.renderer import PixelFilter, Purpose, RandomKey, Rays, why_inseparable
from enfilade.scene.mitsuba.renderer import MitsubaRenderer
from support.mitsuba_scene import (
    DIFFUSE,
    opened,
    placed,
    rgb,
    veil,
    write,
    write_holes,
)

REC709 = np.array([0.2126, 0.7152, 0.0722])


@pytest.fixture(scope="module")
def corner_file(tmp_path_factory):
    """A ball and a lamp over a floor, under a sky: shadows, light that bounces, noise."""
    return write(
        tmp_path_factory.mktemp("corner"),
        """<shape type="rectangle" id="floor"><transform name="to_world"><rotate x="1" angle="-90"/>
<scale value="4"/></transform><bsdf type="diffuse"/></shape>""",
        placed("sphere", "ball", (0, 0.5, 0), '<bsdf type="plastic"/>', scale=0.5),
        f"""<shape type="rectangle" id="lamp"><transform name="to_world"><scale value="0.5"/>
<rotate x="1" angle="90"/><translate y="2.5"/></transform>
<emitter type="area">{rgb("radiance", 6, 5, 4)}</emitter></shape>""",
        sky=f'<emitter type="constant">{rgb("radiance", 0.2, 0.25, 0.3)}</emitter>',
    )


@pytest.fixture(scope="module")
def corner(corner_file):
    return opened(corner_file), Camera(look_at((1, 1.5, 3.5), (0, 0.6, 0)), 45.0, 32, 24)


def everything(camera):
    return np.arange(camera.width * camera.height, dtype=np.uint32)


def traced(renderer, camera, pixels=None, *, spp=4, seed=7, frame=3, at=PixelFilter.BOX, **more):
    pixels = everything(camera) if pixels is None else np.asarray(pixels, np.uint32)
    purpose = more.pop("purpose", Purpose.FILL)
    return renderer.trace(camera, pixels, RandomKey(seed, frame, purpose), spp=spp, pixel_filter=at, **more)


def rendered_by_mitsuba(renderer, camera, spp):
    """Mitsuba's own image of the same view, box filtered, (H * W, 3)."""
    pose = camera.world_from_camera
    sensor = mi.load_dict(
        {
            "type": "perspective",
            "fov": camera.fov_deg,
            "fov_axis": "y",
            "to_world": mi.ScalarTransform4f().look_at(
                origin=pose[:3, 3].tolist(),
                target=(pose[:3, 3] - pose[:3, 2]).tolist(),
                up=pose[:3, 1].tolist(),
            ),
            "film": {
                "type": "hdrfilm",
                "width": camera.width,
                "height": camera.height,
                "pixel_format": "rgb",
                "rfilter": {"type": "box"},
            },
            "sampler": {"type": "independent", "sample_count": spp},
        }
    )
    return np.array(mi.render(renderer._scene, sensor=sensor, spp=spp, seed=5)).reshape(-1, 3)


def test_pixels_are_those_that_mitsuba_renders(corner):
    renderer, camera = corner
    parts, spp = 16, 16
    runs = [traced(renderer, camera, spp=spp, seed=seed) for seed in range(parts)]
    ours = np.array([run.color.astype(float) @ REC709 for run in runs])
    variance = np.mean([run.variance for run in runs], axis=0) / parts  # of independent paths, as theirs are
    theirs = rendered_by_mitsuba(renderer, camera, parts * spp) @ REC709
    difference = ours.mean(axis=0) - theirs
    sigma = np.sqrt(ours.var(axis=0, ddof=1) / parts + variance) + 1e-6
    # The mean of all pixels within five standard errors;
    assert abs(difference.mean()) < 5 * math.sqrt((sigma**2).sum()) / sigma.size
    # each pixel within its noise. Where few paths see a lamp's edge the variance is not well known: the
    # worst percent is left out, which takes a tenth from the mean square of a Gaussian.
    noisy = variance > 1e-7  # not the sky
    assert noisy.mean() > 0.4
    assert np.abs(difference[~noisy]).max() < 1e-3
    scores = np.sort(np.abs(difference / sigma)[noisy])[: int(0.99 * noisy.sum())]
    assert scores.max() < 4
    assert 0.75 < (scores**2).mean() < 1.15
    assert not any(run.dropped for run in runs)


@pytest.mark.parametrize("at", list(PixelFilter))
def test_random_numbers_depend_on_the_pixel_alone(corner, monkeypatch, at):
    renderer, camera = corner
    whole = traced(renderer, camera, spp=70, at=at)  # two passes
    order = np.random.default_rng(4).permutation(everything(camera))
    shuffled = traced(renderer, camera, order, spp=70, at=at)
    assert shuffled.color.tobytes() == whole.color[order].tobytes()
    assert shuffled.variance.tobytes() == whole.variance[order].tobytes()
    monkeypatch.setattr(renderer, "_paths_in_flight", 1024)
    few = traced(renderer, camera, order[:37], spp=70, at=at)
    assert few.color.tobytes() == whole.color[order[:37]].tobytes()


def test_variance_is_that_of_independent_paths(corner):
    renderer, camera = corner
    pixels = everything(camera)[300:500]

    def spread(runs):
        return np.var([run.color.astype(float) @ REC709 for run in runs], axis=0, ddof=1).mean()

    few = [traced(renderer, camera, pixels, spp=16, seed=s) for s in range(40)]
    single = [traced(renderer, camera, pixels, spp=1, seed=s) for s in range(160)]
    claimed = np.mean([run.variance for run in few])
    # Up to 160 estimates a pixel, two hundred pixels: a few percent, more for the heavy tail of paths.
    assert claimed == pytest.approx(spread(single) / 16, rel=0.15)
    # Paths are stratified, which the variance does not know of: it errs on the safe side.
    assert spread(few) < 0.7 * claimed


def test_the_longest_path_is_the_setting(corner, corner_file):
    renderer, camera = corner
    direct = traced(opened(corner_file, max_depth=2), camera, spp=64).color.mean()
    emitted = traced(opened(corner_file, max_depth=1), camera, spp=64).color.mean()
    assert emitted < 0.8 * direct
    assert direct < traced(renderer, camera, spp=64).color.mean()


@pytest.mark.parametrize("is_lamp", [False, True])
def test_the_camera_does_not_see_lamps(tmp_path, is_lamp):
    """Two lamps, one behind the other, before a wall on the left and a mirror on the right."""
    lamp = '<ref id="lamp"/>' if is_lamp else '<bsdf type="null"/>'
    light = f'<emitter type="area"><rgb name="radiance" value="5"/></emitter>{lamp}'
    mirror = '<bsdf type="conductor"><string name="material" value="none"/></bsdf>'
    scale = '<scale x="0.5" y="0.5"/>'
    around = [
        f'<shape type="rectangle"><transform name="to_world">{scale}<translate x="{x}" z="{z}"/></transform>'
        f"{of}</shape>"
        for x, z, of in ((-1, 1, light), (-1, 1.5, light), (-1, 0, DIFFUSE), (1, 0, mirror))
    ]
    back = '<translate x="2.27" z="4"/>'
    around.append(
        f'<shape type="rectangle"><transform name="to_world"><rotate y="1" angle="180"/>{scale}{back}'
        f"</transform>{light}</shape>"
    )
    file = tmp_path / "scene.xml"
    file.write_text(f'<scene version="3.0.0"><bsdf type="null" id="lamp"/>{"".join(around)}</scene>')
    renderer = opened(file)
    camera = Camera(look_at((0, 0, 3), (0, 0, 0)), 60.0, 32, 16)
    colour = traced(renderer, camera, spp=64).color.reshape(16, 32, 3)[8, [10, 20], 0]
    seen = find_geometry(renderer, camera).surface[8, [10, 20]]
    assert colour[1] == pytest.approx(5.0)  # in the mirror
    if is_lamp:
        assert 0.0 < colour[0] < 5.0  # the wall, lit
        assert seen.tolist() == [SurfaceClass.DIFFUSE, SurfaceClass.MIRROR]
    else:
        assert colour[0] > 5.0
        assert seen.tolist() == [SurfaceClass.EMISSIVE, SurfaceClass.MIRROR]


@pytest.mark.parametrize("light", ["", f'<emitter type="area">{rgb("radiance", 5, 5, 5)}</emitter>'])
def test_the_camera_does_not_see_hidden_surfaces(tmp_path, light):
    """A screen before a wall: what is behind looks as from between both, and not as without the screen."""

    def opened_with(screen):
        around = placed("rectangle", "wall", (0, 0, 0), DIFFUSE)
        if screen:
            inside = f'{light}<bsdf id="{screen}" type="twosided">{DIFFUSE}</bsdf>'
            around += f"""<shape type="rectangle"><transform name="to_world"><rotate y="1" angle="180"/>
<scale value="0.5"/><translate z="0.5"/></transform>{inside}</shape>"""
        return opened(write(tmp_path, around, name=f"{screen[:6]}.xml"))

    def seen_from(z, renderer):
        camera = Camera(look_at((0, 0, z), (0, 0, 0)), 5.0, 4, 4)
        return find_geometry(renderer, camera).depth.min(), traced(renderer, camera, spp=1024).color.mean()

    depth, color = seen_from(3, opened_with("hidden from the camera: screen"))
    assert depth == pytest.approx(3.0, rel=1e-3)
    assert color == pytest.approx(seen_from(0.4, opened_with("screen"))[1], rel=0.02)
    assert color != pytest.approx(seen_from(3, opened_with(""))[1], rel=0.2)
    assert seen_from(3, opened_with("screen"))[0] == pytest.approx(2.5, rel=1e-3)


def test_fog_around_the_camera_is_that_of_the_scenes_camera(tmp_path):
    fog = '<medium type="homogeneous" id="fog"><float name="sigma_t" value="0.5"/></medium>'
    around = '<bsdf type="null"/><ref name="exterior" id="fog"/>'
    file = tmp_path / "scene.xml"
    file.write_text(
        f'<scene version="3.0.0"><integrator type="volpath"/>{fog}'
        '<sensor type="perspective"><ref name="medium" id="fog"/></sensor>'
        f"{placed('sphere', 'ball', (0, 0, 0), around)}"
        '<emitter type="point"><rgb name="intensity" value="9"/>'
        '<point name="position" x="0" y="3" z="0"/></emitter>'
        "</scene>"
    )
    renderer, camera = opened(file), Camera(look_at((0, 0.2, 3), (0, 0, 0)), 40.0, 16, 12)
    ours = traced(renderer, camera, spp=64)
    assert (ours.color @ REC709).min() > 0.001  # beside the ball nothing but fog is lit


def test_one_thread_opens_a_scene_with_openexr_files(tmp_path):
    write_holes(tmp_path)
    sky = '<emitter type="envmap"><string name="filename" value="holes.exr"/></emitter>'
    file = write(tmp_path, placed("sphere", "ball", (0, 0, 0), DIFFUSE), sky=sky)
    script = (
        "import sys; from pathlib import Path; import drjit as dr\n"
        "from enfilade.scene.mitsuba.renderer import MitsubaRenderer\n"
        "dr.set_thread_count(1); MitsubaRenderer(Path(sys.argv[1]))\n"
        "print(dr.thread_count())"
    )
    line = [sys.executable, "-c", script, file]
    done = subprocess.run(line, capture_output=True, text=True, timeout=120, check=True)  # noqa: S603
    assert done.stdout.strip() == "1"


def compiled_since():
    return [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT and not k["cache_hit"]]


def test_no_kernel_is_compiled_from_frame_to_frame(corner):
    renderer, _ = corner

    def frame(index):
        camera = Camera(look_at((1 + 0.1 * index, 1.5, 3.5), (0, 0.6, 0)), 45.0 + index, 32, 24)
        find_geometry(renderer, camera)
        pixels = everything(camera)[index : 300 + 7 * index]
        for at in (PixelFilter.CENTRE, PixelFilter.BOX):
            traced(renderer, camera, pixels, spp=70, seed=index, frame=index, at=at)

    gc.collect()  # scenes of other tests: when materials go, kernels that might call them change
    frame(0)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        for index in range(1, 7):
            frame(index)
        assert not compiled_since()


def test_kernels_of_masked_materials_serve_any_number_of_lanes(tmp_path):
    """A reduction over channels and lanes would compile their number."""
    renderer = opened(write(tmp_path, placed("sphere", "ball", (0, 0, 0), veil(0.3))))

    def albedo(count):
        rays = Rays(Array3f(0.1, 0.1, 5.0) + dr.zeros(Array3f, count), Array3f(0.0, 0.0, -1.0))
        dr.eval(renderer.intersect(rays).surfaces.albedo)

    albedo(100)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        albedo(300)
        assert not compiled_since()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("<scene version='3.0.0'><shape", "scene.xml"),
        ("<scene version='3.0.0'><shape type='nothing'/></scene>", "nothing"),
        (
            "<scene version='3.0.0'><shape type='ply'><string name='filename' value='gone'/></shape></scene>",
            "gone",
        ),
        ("<scene version='3.0.0'></scene>", "no shapes"),
        ("<scene version='3.0.0'><shape type='sphere'/></scene>", "add an <emitter>; or, in Blender, a lamp"),
        ("", "scene.xml"),
        ("just words", "scene.xml"),
    ],
)
def test_wrong_scenes_are_named_with_the_reason(tmp_path, text, reason):
    file = tmp_path / "scene.xml"
    file.write_text(text)
    with pytest.raises(SceneError, match=re.escape(str(file))) as caught:
        opened(file)
    assert reason in str(caught.value)


@pytest.mark.parametrize(
    "error", [MemoryError(), RuntimeError("jit_malloc(): out of memory!"), RuntimeError("std::bad_alloc")]
)
def test_too_little_memory_is_no_fault_of_the_scene(tmp_path, monkeypatch, error):
    def scarce(*_arguments, **_options):
        raise error

    monkeypatch.setattr(mi.parser, "instantiate", scarce)
    with pytest.raises(MemoryError):
        opened(write(tmp_path, placed("sphere", "ball", (0, 0, 0), DIFFUSE)))


def test_the_cost_is_in_proportion_to_the_list(corner, monkeypatch):
    renderer, camera = corner
    radiance, paths = renderer._radiance, []

    def counted(rays, sampler):
        paths.append(dr.width(rays.direction))
        return radiance(rays, sampler)

    monkeypatch.setattr(renderer, "_radiance", counted)
    for count, spp in ((768, 70), (38, 70), (1, 1), (0, 64)):
        paths.clear()
        traced(renderer, camera, everything(camera)[:count], spp=spp)
        assert sum(paths) == count * spp


def test_a_mesh_with_nan_vertices_is_refused(tmp_path):
    (tmp_path / "door.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n")
    shape = '<shape type="obj"><string name="filename" value="door.obj"/></shape>'
    light = '<emitter type="constant"/>'
    (tmp_path / "scene.xml").write_text(f'<scene version="3.0.0">{shape}{light}</scene>')
    with pytest.raises(SceneError, match=r'scene\.xml .*OBJ file "door\.obj": .*invalid vertex position'):
        MitsubaRenderer(tmp_path / "scene.xml")


def test_tables_of_lobes_are_made_for_the_methods_that_read_them(corner_file):
    renderer, camera = opened(corner_file), Camera(look_at((1, 1.5, 3.5), (0, 0.6, 0)), 45.0, 32, 24)
    find_geometry(renderer, camera)
    traced(renderer, camera)
    assert why_inseparable(renderer) == ""
    made = vars(renderer), vars(renderer._lobes)
    assert not any(name in of for of in made for name in ("_transport", "specular_albedos"))
    assert renderer.state()
    assert "_transport" in made[0]
    assert "specular_albedos" in made[1]


def test_arrays_of_a_scene_are_aligned_like_those_of_dr_jit(corner):
    # Kernels differ by the alignment of their inputs, which NumPy's memory has by chance.
    def arrays(state):
        if isinstance(state, tuple):
            return [array for of in state for array in arrays(of)]
        return [np.asarray(state)] if isinstance(state, Float | UInt | Bool) and len(state) > 1 else []

    renderer, _ = corner
    found = arrays((renderer._shapes.state, renderer._lobes.state, renderer._transport.sharp_emitters.state))
    assert len(found) > 12
    assert {array.ctypes.data % ALIGNMENT for array in found} == {0}
