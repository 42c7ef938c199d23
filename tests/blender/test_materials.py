"""Materials that are easily lost, as they are exported."""

import shutil
from xml.etree import ElementTree as ET

import mitsuba as mi
import numpy as np
import pytest
from PIL import Image

from enfilade.images import read_exr
from enfilade.scene.mitsuba.files import check_scene
from enfilade.settings import LimitSettings
from enfilade_blender.materials.ggx import metal_scale
from support.imported import traced

pytestmark = [pytest.mark.blender, pytest.mark.slow]
NAME = "uncommon_materials"


@pytest.fixture(scope="module")
def made(blender):
    """Folder, elements by id, and notes by material."""
    code, out, result = blender.job(blender.make(NAME)[0], NAME)
    assert code == 0, result
    check_scene(out / "scene.xml", LimitSettings())
    assert mi.load_file(str(out / "scene.xml")).shapes()
    parsed = ET.parse(out / "scene.xml").iter()
    elements = {e.get("id"): e for e in parsed if e.tag != "ref" and e.get("id")}
    notes = {}
    for note in result["notes"]:
        notes.setdefault(note["object"], []).append(note["what"])
    return out, elements, notes


def pixels(folder, texture):
    file = texture.find("string[@name='filename']").get("value")
    return np.array(mi.Bitmap(str(folder / file))) / 255.0


def test_an_inverted_opacity_is_that_of_the_baked_image(made):
    out, elements, _ = made
    found = pixels(out, elements["material cut out"].find("texture[@name='opacity']"))
    linear = [(code / 1.055 + 0.055 / 1.055) ** 2.4 for code in (0.8, 0.4)]
    # The texels beside the border of the halves are between them.
    assert np.percentile(found, [5, 95]) == pytest.approx([1.0 - x**2 for x in linear], abs=0.01)


def test_the_far_wall_of_a_closed_emitter_is_seen_through_the_near_one(made):
    out, elements, _ = made
    files = [elements[name].find("string[@name='filename']").get("value") for name in ("Ghost", "Ghost back")]
    meshes = [mi.traverse(mi.load_dict({"type": "ply", "filename": str(out / file)})) for file in files]
    front, back = (np.unique(np.array(m["vertex_positions"]).reshape(-1, 3), axis=0) for m in meshes)
    apart = np.linalg.norm(back[:, None] - front, axis=-1).min(axis=1)
    # A ray that leaves one of the two begins beyond the other: the surface is passed once.
    assert (apart < mi.math.RayEpsilon * (1.0 + np.abs(back).max(axis=1))).all()
    assert (apart > 0.0).all()


def test_a_colour_is_multiplied_by_an_alpha_that_is_not_used(made):
    out, elements, _ = made
    found = pixels(out, elements["material premultiplied"].find(".//texture"))
    assert found[0, [0, -1], 0] == pytest.approx([0.8, 0.4], abs=1e-2)


def test_textured_glass_is_passed_twice(made):
    out, elements, _ = made
    glass = elements["material stained glass"]
    assert glass.get("type") == "dielectric"
    found = pixels(out, glass.find("texture[@name='specular_transmittance']"))
    linear = ((found[0, [0, -1], 0] + 0.055) / 1.055) ** 2.4
    wanted = np.array([(code / 1.055 + 0.055 / 1.055) ** 2.4 for code in (0.8, 0.4)])
    assert linear == pytest.approx(np.sqrt(wanted), abs=0.01)


def test_a_rewritten_image_is_looked_up_as_the_image(made):
    _, elements, notes = made
    texture = elements["material pixelated"].find(".//texture")
    settings = {string.get("name"): string.get("value") for string in texture.iter("string")}
    assert "times" in settings["filename"]
    assert (settings["filter_type"], settings["wrap_mode"]) == ("nearest", "clamp")
    assert "half" not in notes


def test_beyond_a_clipped_image_there_is_nothing(made):
    scene = mi.load_file(str(made[0] / "scene.xml"), optimize=False)
    decal = next(shape for shape in scene.shapes() if shape.id() == "decal")
    x = np.array([-0.6, -0.15, 0.15, 0.6]) + decal.bbox().center().x
    si = scene.ray_intersect(mi.Ray3f(mi.Point3f(x, 0.1, 1.0), mi.Vector3f(0.0, 0.0, -1.0)))
    passed = np.array(si.bsdf().eval_null_transmission(si))[0]
    assert passed == pytest.approx([1.0, 0.0, 0.5, 1.0], abs=0.02)


def test_a_baked_colour_above_1_is_kept(made):
    _, elements, _ = made
    texture = elements["material bright: bright"].find(".//texture")
    assert texture.find("boolean[@name='raw']").get("value") == "true"
    assert texture.find("string[@name='filename']").get("value").endswith(".exr")


def test_brushed_metal_is_stretched_along_its_uv_map(made):
    out, _, notes = made
    assert b"property float u" in (out / "meshes" / "brushed.ply").read_bytes()
    assert "the rotation is left out" in notes["brushed"]
    assert "its anisotropy is left out" in notes["brushed by image"]


def test_a_coloured_roughness_is_its_luminance(made):
    out, elements, _ = made
    found = pixels(out, elements["material green mirror"].find(".//texture[@name='alpha']"))
    wanted = (0.7152 * np.array([0.2, 0.8])) ** 2
    assert found.reshape(16, 16)[0, [0, -1]] == pytest.approx(wanted, abs=4e-3)


def test_transparency_that_is_lost_is_noted(made):
    _, elements, notes = made
    opacity = elements["material see-through"].find("float[@name='opacity']").get("value")
    assert float(opacity) == pytest.approx(1.0 - (0.2 * 0.2127 + 0.5 * 0.7152 + 0.9 * 0.0722), abs=1e-3)
    assert notes["see-through"] == ["the tint of transparency is left out"]
    assert notes["sheer gloss"] == ["a sum of two BSDFs is a mix of equal shares"]
    kinds = [e.get("type") for e in elements["material sheer gloss"].iter("bsdf")]
    assert kinds == ["blendbsdf", "mask", "twosided", "diffuse", "twosided", "roughconductor"]


def test_a_rough_plastic_keeps_its_highlight_below_a_coat(made):
    _, elements, _ = made
    rough = [e for e in elements["material varnished"].iter("bsdf") if e.get("type").startswith("rough")]
    alphas = {e.get("type"): float(e.find("float[@name='alpha']").get("value")) for e in rough}
    assert alphas == pytest.approx({"roughplastic": 0.25, "roughconductor": 0.01})


def test_plastic_by_fresnel_keeps_its_normals(made):
    _, elements, notes = made
    plastic = elements["material bumpy plastic"].find(".//bsdf[@type='bumpmap']/bsdf")
    assert plastic.get("type") == "roughplastic"
    assert "the tint of reflections is left out" in notes["bumpy plastic"]


def test_a_picture_of_another_folder_is_missing(blender, made, tmp_path):
    _, _, notes = made
    assert "picture.png" not in notes
    apart = tmp_path / "apart.blend"
    shutil.copyfile(blender.folder / "files" / f"{NAME}.blend", apart)
    code, out, result = blender.job(apart, "apart picture")
    (note,) = [
        note for note in result["notes"] if note["kind"] == "not-carried" and "folders" in note["what"]
    ]
    assert (code, note["object"]) == (0, "picture.png")
    assert note["effect"] == f"the image is missing; allow {blender.folder / 'files'}"
    assert not list((out / "textures").glob("picture*"))


def test_opacity_dims_what_is_emitted(made):
    _, elements, _ = made
    radiance = elements["faint glow"].find("emitter/rgb").get("value")
    assert radiance.split() == ["1", "1", "1"]


def test_coordinates_times_constants_are_not_baked(made):
    _, elements, notes = made
    (texture,) = elements["material scaled"].iter("texture")
    matrix = np.array(texture.find("transform/matrix").get("value").split(), float)
    assert matrix[[0, 5]] == pytest.approx([3.0, -3.0], abs=1e-5)
    assert "scaled" not in notes


def test_metal_has_no_transmission(made):
    bsdf = made[1]["material plated"]
    (metal,) = [nested for nested in bsdf.iter("bsdf") if nested.find("bsdf") is None]
    assert metal.get("type") == "roughconductor"
    assert float(metal.find("float[@name='alpha']").get("value")) == pytest.approx(0.05**2)


def test_a_mix_with_transparent_by_the_kind_of_ray_is_its_other_side(blender):
    code, out, result = blender.job(blender.make("kinds_of_rays")[0], "kinds of rays")
    assert code == 0, result
    root = ET.parse(out / "scene.xml").getroot()
    found = {element.get("id"): element for element in root}
    assert not [note for note in result["notes"] if note["node"] == "Light"]  # one surface shines
    radiance = found["unlit"].find("emitter/rgb").get("value").split()
    assert [float(number) for number in radiance] == pytest.approx([1.0, 0.5, 0.2])
    assert found["material shadowless"].find("bsdf").get("type") == "diffuse"
    # The same for a number that a bake computes: all rays are diffuse ones.
    assert found["material by ray: by ray"].find(".//rgb").get("value") == "0.5 0.5 0.5"
    noted = {note["object"] for note in result["notes"] if "transparent for some rays" in note["what"]}
    assert noted == {"unlit", "shadowless"}
    (ray,) = (note for note in result["notes"] if note["node"] == "Light Path")
    assert (ray["object"], ray["what"]) == ("by number", "Is Diffuse Ray is taken as 0")
    assert ray["effect"] == "all rays see it as those do in Blender for which that is 0"


def test_a_file_that_was_saved_in_edit_mode_has_its_meshes(blender):
    code, out, result = blender.job(blender.make("left_in_edit_mode")[0], "left in edit mode")
    assert code == 0, result
    assert {file.stem for file in (out / "meshes").iterdir()} == {"Plain", "Rounded"}


def test_glass_without_a_back_is_thin(blender):
    code, out, result = blender.job(blender.make("sheets_of_glass")[0], "sheets of glass")
    assert code == 0, result
    root = ET.parse(out / "scene.xml").getroot()
    bsdfs = {element.get("id"): element.get("type") for element in root.findall("bsdf")}
    kinds = {shape.get("id"): bsdfs[shape.find("ref").get("id")] for shape in root.findall("shape")}
    assert kinds == {
        **{f"clear {x}": "thindielectric" for x in (-2, 0)},
        **{f"frosted {x}": "principledthin" for x in (-2, 0)},
        "Ball": "dielectric",
    }
    noted = [note["object"] for note in result["notes"] if "of an open mesh" in note["what"]]
    assert sorted(noted) == ["clear", "frosted"]


def test_clear_glass_that_shadow_rays_pass_is_thin_but_on_solid_objects(blender):
    code, out, result = blender.job(blender.make("kinds_of_panes")[0], "kinds of panes")
    assert code == 0, result
    root = ET.parse(out / "scene.xml").getroot()
    assert root.find("integrator").get("type") == "volpath"
    bsdfs = {element.get("id"): element for element in root.findall("bsdf")}
    of = {shape.get("id"): bsdfs[shape.find("ref").get("id")] for shape in root.findall("shape")}
    kinds = {name: bsdf.find(".//bsdf") or bsdf for name, bsdf in of.items()}
    assert {name: kind.get("type") for name, kind in kinds.items() if not name.endswith("back")} == {
        "Pane": "thindielectric",
        "Ball": "dielectric",
        "layered": "thindielectric",
        "lit": "dielectric",
        "swapped": "dielectric",
    }
    tint = of["Pane"].find("rgb[@name='specular_transmittance']").get("value").split()
    assert [float(number) for number in tint] == pytest.approx([0.5] * 3)  # of each of two faces
    noted = {(note["object"], note["what"]) for note in result["notes"]}
    assert ("tinted", "clear glass that shadow rays pass is thin glass") in noted
    assert ("tinted", "glass that shadow rays pass stops them on solid objects") in noted
    other = {name for name, what in noted if "transparent for some rays" in what}
    assert other == {"lit", "swapped"}


@pytest.mark.parametrize(
    "name",
    ["leaves", "lamps_in_the_way", "tilted", "painted_lamps", "single_scattering", "panes", "masked_light"],
)
def test_light_is_that_of_cycles(blender, name):
    (source,) = blender.make(name)
    code, out, result = blender.job(source, name)
    assert code == 0, result
    _, theirs, _ = blender.job(source, f"{name} of cycles", task="cycles", spp=64, unbiased=True)
    wanted = read_exr(theirs / "cycles-0001.exr")["RGB"].mean(axis=(0, 1))
    # A floor of 0.5, less the edges of cards; their light alone would be 0.04. The noise is 1 %.
    assert traced(out, 64).mean(axis=(0, 1)) == pytest.approx(wanted, rel=0.03)


def test_generated_coordinates_are_those_before_modifiers(blender):
    code, out, result = blender.job(blender.make("modified_and_generated")[0], "generated")
    assert code == 0, result
    _, theirs, _ = blender.job(
        blender.make("modified_and_generated")[0], "generated of cycles", task="cycles", spp=64, unbiased=True
    )
    wanted, found = read_exr(theirs / "cycles-0001.exr")["RGB"], traced(out, 64)
    difference = found - wanted
    # 0.019 of noise and interpolated edges; with coordinates of the modified objects it is 0.056.
    assert np.sqrt(np.square(difference).mean()) < 0.03


def test_missing_images_are_grey_wherever_cycles_looks_them_up(blender):
    code, out, result = blender.job(blender.make("missing_images")[0], "missing images")
    assert code == 0, result
    sky = np.array(mi.Bitmap(str(out / "textures" / "environment.exr")))
    assert sky.reshape(-1, 3).mean(axis=0) == pytest.approx([0.5, 0.5, 0.5], abs=1e-3)
    colours = [e.get("value") for e in ET.parse(out / "scene.xml").findall(".//bsdf[@type='diffuse']/rgb")]
    assert [float(number) for number in " ".join(colours).split()] == pytest.approx([0.5] * 3, abs=1e-3)
    noted = [note["object"] for note in result["notes"] if "missing" in note["what"]]
    assert noted == ["corrected", "late", "World"]
    assert [file.name for file in (out / "textures").glob("shown*")]


def test_pictures_that_mitsuba_reads_wrongly_are_written_anew(blender):
    files = blender.folder / "files"
    files.mkdir(exist_ok=True)
    kinds = {"bmp": "P", "jpg": "CMYK", "tga": "P"}
    for ending, mode in kinds.items():
        Image.new("RGB", (8, 8), (153, 153, 153)).convert(mode).save(files / f"foreign.{ending}")
    code, out, result = blender.job(blender.make("picture_files")[0], "picture files")
    assert code == 0, result
    left_out = {(note["object"], note["node"], note["what"]) for note in result["notes"]}
    assert left_out >= {
        ("Camera", "Camera", "an orthographic camera can't be exported"),
        ("Scene", "Light", "there is no light"),
    }
    copies = sorted((out / "textures").iterdir())
    assert [file.suffix for file in copies] == [".png"] * len(kinds)
    for file in copies:
        assert np.array(mi.Bitmap(str(file)), float) == pytest.approx(153.0, abs=2.0)


def test_normal_maps_are_mirrored_with_their_uv_maps(blender):
    code, out, result = blender.job(blender.make("mirrored_normals")[0], "mirrored normals")
    assert code == 0, result
    scene = mi.load_file(str(out / "scene.xml"))
    places = [0.1, 2.1, 4.1, 6.1, 8.5, 7.5, 10.1, 12.1, -1.9]
    ray = mi.Ray3f(mi.Point3f(places, 0.1, 3.0), mi.Vector3f(0.0, 0.0, -1.0))
    si = scene.ray_intersect(ray)
    sample, _ = si.bsdf().sample(mi.BSDFContext(), si, 0.5, mi.Point2f(0.5))
    half = np.add(np.array(si.to_world(sample.wo)).T, [0.0, 0.0, 1.0])
    # Cycles' normals: a mirrored v turns the tilt round, a mirrored u and a reflection along it do not. Seen
    # from behind, the normal of the front is negated, also that of an image of heights.
    tilts = np.array([1.0, 1.0, -1.0, 1.0, 1.0, 1.0, -1.0, 1.0, 0.0]) * 0.6
    found = half / np.linalg.norm(half, axis=1, keepdims=True)
    assert found[:, 1] == pytest.approx(tilts, abs=0.01)
    assert found[:, 2] == pytest.approx(0.8, abs=0.01)
    assert found[8, 0] == pytest.approx(0.6, abs=0.01)
    sides = {e.get("id"): len(e.findall("bsdf")) for e in ET.parse(out / "scene.xml").getroot().iter("bsdf")}
    assert sorted(count for name, count in sides.items() if name) == [
        0,
        1,
        1,
        1,
        1,
        2,
        2,
    ]  # the first of lamps


def test_normals_of_bumps_are_mixed_by_their_strength(blender):
    code, out, result = blender.job(blender.make("soft_bumps")[0], "soft bumps")
    assert code == 0, result
    scene = mi.load_file(str(out / "scene.xml"))
    si = scene.ray_intersect(mi.Ray3f(mi.Point3f([0.1, 3.1], 0.1, 3.0), mi.Vector3f(0.0, 0.0, -1.0)))
    sample, _ = si.bsdf().sample(mi.BSDFContext(), si, 0.5, mi.Point2f(0.5))
    half = np.add(np.array(si.to_world(sample.wo)).T, [0.0, 0.0, 1.0])
    slopes = np.array([0.75, 0.375])
    steep = np.stack([0.0 * slopes, -slopes, 1.0 + 0.0 * slopes], axis=-1)
    mixed = steep / np.linalg.norm(steep, axis=-1, keepdims=True) + [0.0, 0.0, 1.0]
    # By their scale alone the slopes were 0.375 and 0.19, not 0.33 and 0.18.
    assert half[:, 1] / half[:, 2] == pytest.approx(mixed[:, 1] / mixed[:, 2], rel=0.03)
    assert [note["what"] for note in result["notes"] if note["object"] == "soft"] == [
        "slopes of bumps are scaled alike, by 0.44"
    ]


def test_the_alpha_of_a_colour_attribute_and_several_attributes_are_baked(blender):
    code, out, result = blender.job(blender.make("painted")[0], "painted")
    assert code == 0, result
    scene = ET.parse(out / "scene.xml").getroot()
    opacity = scene.find(".//bsdf[@type='mask']/float[@name='opacity']").get("value")
    assert float(opacity) == pytest.approx(0.25, abs=1e-3)
    mixed = scene.findall("bsdf[@id='material both: both']//rgb")
    colours = [[float(number) for number in colour.get("value").split()] for colour in mixed]
    assert np.array(colours) == pytest.approx(np.array([[0.8, 0.1, 0.1], [0.1, 0.6, 0.1]]), abs=1e-3)


def test_numbers_and_vectors_of_meshes_are_colours(blender):
    code, out, result = blender.job(blender.make("attributes")[0], "attributes")
    assert code == 0, result
    assert [note["what"] for note in result["notes"]] == ["there is no light"]
    scene = mi.load_file(str(out / "scene.xml"))
    si = scene.ray_intersect(
        mi.Ray3f(mi.Point3f([0.0, 2.0, 4.0, -2.0], 0.1, 3.0), mi.Vector3f(0.0, 0.0, -1.0))
    )
    found = np.array(si.bsdf().eval_diffuse_reflectance(si)).T
    wanted = [[0.25] * 3, [0.2, 0.4, 0.6], [0.3] * 3, [0.3, 0.6, 0.0]]
    assert found == pytest.approx(np.array(wanted), abs=2e-3)


def test_the_number_of_a_colour_is_its_luminance_and_that_of_a_vector_its_mean(blender):
    code, out, result = blender.job(blender.make("numbers")[0], "numbers")
    assert code == 0, result
    weights = ET.parse(out / "scene.xml").findall(".//bsdf[@type='blendbsdf']/float[@name='weight']")
    # Cycles' weights of red and green: 0.2127 and 0.7152.
    wanted = [0.9 * 0.2127 + 0.3 * 0.7152, 0.6, 0.5]
    assert [float(weight.get("value")) for weight in weights] == pytest.approx(wanted, abs=2e-3)


def test_heights_and_normals_have_all_digits(blender):
    code, out, result = blender.job(blender.make("heights")[0], "heights")
    assert code == 0, result
    bsdfs = {e.get("id"): e for e in ET.parse(out / "scene.xml").getroot().findall("bsdf")}

    def found(name, of):
        (texture,) = bsdfs[f"material {name}"].iterfind(f".//{of}")
        file = texture.find("string[@name='filename']").get("value")
        return np.array(mi.Bitmap(str(out / file)), np.float32)[..., 0]

    values = {name: found(name, "bsdf[@type='bumpmap']/texture") for name in ("below 0", "low", "as it is")}
    assert (values["below 0"].min(), values["below 0"].max()) == pytest.approx((-0.49, 0.49), abs=0.01)
    assert values["low"].max() == pytest.approx(0.004, abs=1e-4)
    assert np.diff(values["as it is"][32]) == pytest.approx(1.0 / 64.0, abs=1e-5)
    scale = bsdfs["material bumps"].find(".//bsdf[@type='bumpmap']/float[@name='scale']").get("value")
    assert float(scale) == pytest.approx(0.3)
    noted = [(n["kind"], n["object"]) for n in result["notes"] if n["node"] == "Displacement"]
    left_out = ("not-carried", "moved"), ("not-carried", "own bumps")
    assert noted == [("approximated", "moved and bumps"), *left_out]
    # Baked beside noise, between the image's pixels.
    name = "beside noise: beside noise"
    assert len(np.unique(found(name, "bsdf[@type='bumpmap']/texture"))) > 64
    assert len(np.unique(found("normals: normals", "texture[@name='normalmap']"))) > 256
    assert found("rough", "texture[@name='alpha']").max() == 1.0
    gains = found("rough", "texture[@name='specular_reflectance']")
    assert (gains.min(), gains.max()) == pytest.approx((1.0, metal_scale(0.8, 1.0)), abs=0.01)
    assert bsdfs["material polished"].find(".//rgb[@name='specular_reflectance']").get("value") == "1 1 1"


def test_what_depends_on_the_view_or_on_light_is_noted(blender):
    code, out, result = blender.job(blender.make("of_view")[0], "of view")
    assert code == 0, result
    noted = {(n["object"], n["node"], n["what"]) for n in result["notes"] if n["kind"] == "approximated"}
    toon = "the light on a surface is no colour in Cycles, where the input's own value holds"
    assert noted == {
        ("bumps, bumps", "Bump", "it depends on the view"),
        ("wires, wires", "Wireframe", "it depends on the view"),
        ("toon", "Shader to RGB", toon),
    }
    colour = ET.parse(out / "scene.xml").find("bsdf[@id='material toon']//rgb").get("value")
    assert [float(number) for number in colour.split()] == pytest.approx([0.7, 0.2, 0.1])


def test_few_copies_are_baked_at_their_places_in_the_world(blender):
    code, out, result = blender.job(blender.make("copies_in_the_world")[0], "copies")
    assert code == 0, result
    scene = mi.load_file(str(out / "scene.xml"))
    ray = mi.Ray3f(mi.Point3f([0.2, 0.8], [0.2, 0.6], 1.0), mi.Vector3f(0.0, 0.0, -1.0))
    si = scene.ray_intersect(ray)
    found = np.array(si.bsdf().eval_diffuse_reflectance(si)).T
    assert found == pytest.approx(np.array([[0.2, 0.2, 0.0], [0.8, 0.6, 0.0]]), abs=0.01)
    notes = [note["what"] for note in result["notes"] if note["object"] == "place"]
    assert notes == ["of 65 copies of many: many copied the first one's place in the world is taken"]
