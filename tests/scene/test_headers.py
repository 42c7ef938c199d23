"""Headers are read as Mitsuba reads them: a file that shows us one size and Mitsuba another is refused."""

import struct

import mitsuba as mi
import pytest
from PIL import Image

from enfilade.device import active
from enfilade.errors import ImageError, SceneError
from enfilade.images.stills import image_pixels
from enfilade.scene.headers import mesh_elements, pixels
from enfilade.scene.scenecheck import check_scene
from enfilade.settings import LimitSettings

FORMAT = b"format binary_little_endian 1.0\n"
VERTEX = b"property float x\nproperty float y\nproperty float z\n"
FACE = b"property list uchar int vertex_indices\n"
DATA = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0) + struct.pack("<B3i", 3, 0, 1, 2)


def ply(vertices, faces=b"element face 1\n", start=b"ply\n"):
    return start + FORMAT + vertices + VERTEX + faces + FACE + b"end_header\n" + DATA


@pytest.fixture
def named(scene):
    """Write a file that a plugin of a scene reads; returns the scene and the file."""

    def write(name, data, plugin="ply"):
        file = scene(f'<shape type="{plugin}"><string name="filename" value="{name}"/></shape>')
        (file.parent / name).write_bytes(data)
        return file, file.parent / name

    return write


def refused(file, words, **limits):
    with pytest.raises(SceneError, match=words):
        check_scene(file, LimitSettings(**limits))


PLY_HEADERS = [
    b"element vertex 3\n",
    b"comment element vertex 1\nelement vertex 3\n",
    b"comment end_header\n  element\tvertex 3\n",
    b"element vertex 3\r\n",
    b"comment x\n\nelement vertex 3\n",
]


@pytest.mark.parametrize("header", PLY_HEADERS)
@pytest.mark.parametrize("start", [b"ply\n", b"\ncomment x\nply\n"])
def test_a_mesh_has_as_many_vertices_as_mitsuba_finds(named, header, start):
    scene, file = named("mesh.ply", ply(header, start=start))
    mi.set_variant(active().variant)
    mesh = mi.load_dict({"type": "ply", "filename": str(file)})
    assert mesh_elements(file) == {"vertex": mesh.vertex_count(), "face": mesh.face_count()}
    check_scene(scene, LimitSettings())


@pytest.mark.parametrize("name", ["mesh.ply", "mesh.dat"])
@pytest.mark.parametrize(
    ("header", "words"),
    [
        (b"comment element vertex 1\nelement vertex 900000000\n", "900 million elements"),
        (b"comment end_header\nelement vertex 900000000\n", "900 million elements"),
        (b" element vertex 900000000\n", "900 million elements"),
        (b"element vertex 1\nelement vertex 900000000\n", "900 million elements"),
        (b"element vertex 9000\n", "9000 of vertex, but is too short"),
        (b"element vertex 9x\n", "header is damaged"),
        (b"element vertex -1\n", "header is damaged"),
        (b"element vertex 9000000000000000000000\n", "header is damaged"),
        (b"element vertex 3 4\n", "header is damaged"),
        (b"element\n", "header is damaged"),
        (b"ele\rment vertex 3\n", "header is damaged"),
        (b"element edge 900000000\n", "900 million elements"),
        (b"comment " + b"x" * 70_000 + b"\nelement vertex 3\n", "header is damaged"),
    ],
)
def test_meshes_whose_header_hides_its_counts(named, name, header, words):
    refused(named(name, ply(header))[0], words)


def targa(width, height):
    head = bytes([0, 0, 2, *[0] * 9]) + struct.pack("<HHBB", width, height, 24, 0)
    return head + b"\1" * 36 + b"\0" * 8 + b"TRUEVISION-XFILE.\0"


RADIANCE = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n"
PICTURES = [
    (RADIANCE + b"\n-Y 2 +X 3\n" + b"\1\2\3\x80" * 6, 6),
    (RADIANCE + b"-Y 2 +X 3\n\n-Y 1 +X 1\n" + b"\1\2\3\x80" * 6, 6),
    (RADIANCE + b"-Y,2,+X,3\n\n-Y 1 +X 1\n" + b"\1\2\3\x80" * 6, 6),
    (RADIANCE + b"\na 1 b 1\n-Y 2 +X 3\n" + b"\1\2\3\x80" * 6, 6),
    (targa(4, 3), 12),
    (b"Pf\n3 2\n-1\n" + b"\0" * 24, 6),
    (b"P6\n3 2\n255\n" + b"\0" * 18, 6),
]


@pytest.mark.parametrize("name", ["picture.hdr", "picture.dat"])
@pytest.mark.parametrize(("data", "count"), PICTURES)
def test_a_picture_has_as_many_pixels_as_mitsuba_finds(tmp_path, name, data, count):
    file = tmp_path / name
    file.write_bytes(data)
    mi.set_variant(active().variant)
    width, height = mi.Bitmap(str(file)).size()
    assert pixels(file) == width * height == count


@pytest.mark.parametrize("name", ["picture.png", "picture", "picture.obj"])
@pytest.mark.parametrize(
    ("data", "words"),
    [
        (RADIANCE + b"-Y 99999 +X 99999\n\n-Y 1 +X 1\n", "9999.8 million pixels"),
        (RADIANCE + b"\na 1 b 1\n-Y 99999 +X 99999\n", "9999.8 million pixels"),
        (RADIANCE + b"-Y 9x +X 9\n\n-Y 1 +X 1\n", "without a size"),
        (b"PFx4294967295 1 1 -1\n", "header is damaged"),
        (b"\0\0\2\0\1\0" + targa(65535, 65535)[6:], "4294.84 million pixels"),  # also a cursor's header
        (b"PF\n40000 30000\n-1.0\n\0", "1200 million pixels"),
        (b"P6\n40000 30000\n255\n\0", "1200 million pixels|can't read"),
    ],
)
def test_pictures_are_known_by_what_is_in_them(named, name, data, words):
    refused(named(name, data, plugin="obj")[0], words)


def test_the_kinds_of_pictures_are_those_that_mitsuba_reads(tmp_path):
    for kind in ("PNG", "BMP", "JPEG", "PPM", "TGA"):
        Image.new("RGB", (4, 3)).save(tmp_path / "a.png", kind)
        assert image_pixels(tmp_path / "a.png") == 12
    for kind in ("TIFF", "ICO", "GIF"):
        Image.new("RGB", (16, 16)).save(tmp_path / "a.png", kind)
        with pytest.raises(ImageError, match="can't read"):
            image_pixels(tmp_path / "a.png")
    (tmp_path / "a.png").write_bytes(RADIANCE + b"\n-Y 2 +X 3\n")  # left to `pixels`
    with pytest.raises(ImageError, match="can't read"):
        image_pixels(tmp_path / "a.png")


def test_a_large_picture_by_another_name(named):
    scene, file = named("table", b"")
    for kind in ("PNG", "BMP", "JPEG"):
        Image.new("L", (4000, 3000)).save(file, kind)
        with pytest.raises(SceneError, match="12 million pixels"):
            check_scene(scene, LimitSettings(megapixels=11))


def volume(*sides, numbers):
    return b"VOL\x03" + struct.pack("<5i6f", 1, *sides, *[0.0] * 6) + b"\0" * 4 * numbers


def test_volumes_have_the_numbers_that_they_claim(named):
    check_scene(named("grid.vol", volume(2, 2, 2, 3, numbers=24), plugin="x")[0], LimitSettings())
    refused(named("grid.vol", volume(2, 2, 2, 3, numbers=23), plugin="x")[0], "says that it has 24 numbers")
    huge = volume(65536, 65536, 1, 1, numbers=0)  # 2^32: none, for who counts in 32 bits
    refused(named("grid", huge, plugin="x")[0], "4294967296 numbers")
    refused(named("grid", huge[:20], plugin="x")[0], "header is damaged")
