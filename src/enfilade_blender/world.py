# SPDX-License-Identifier: GPL-3.0-or-later
"""The world: a constant emitter, or an environment map that Cycles renders of it, with the sun's disc."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from enfilade_blender.evaluate import note_rays
from enfilade_blender.image_files import F32, write_exr
from enfilade_blender.lights import Sun
from enfilade_blender.materials.graph import Graph
from enfilade_blender.materials.image_pixels import fault, linear_pixels
from enfilade_blender.materials.stand_ins import IMAGES, put_stand_ins
from enfilade_blender.materials.table import VIEW_SOCKETS
from enfilade_blender.materials.textures import ENVIRONMENT
from enfilade_blender.materials.values import Constant, Emission, Nothing
from enfilade_blender.motion import trees
from enfilade_blender.notes import Notes
from enfilade_blender.records import Selection
from enfilade_blender.scene_xml import Element, plugin

WIDTH, WIDTH_SUN, WIDTH_MAX = 1024, 2048, 4096
SAMPLES, SAMPLES_SKY = 4, 16  # a pixel; the sun of a sky is smaller than one
LOCAL_FROM_WORLD = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], np.float64)
RAYS_OF_WORLDS = ("camera", "diffuse", "glossy", "transmission")
FILE = f"textures/{ENVIRONMENT}.exr"


def environment(selection: Selection, sun: Sun | None, folder: Path, notes: Notes) -> list[Element]:
    """The world's emitter; none where it is black and without a sun."""
    world = selection.world
    _note_world(selection, notes)
    plain = _plain(world, notes)
    if plain is not None:
        r, g, b = _positive(np.array(plain), world, notes).tolist()
        plain = (r, g, b)
    if plain is not None and sun is None:
        return [plugin("emitter", "constant", radiance=plain)] if max(plain) > 0.0 else []
    if plain is not None:
        image = np.broadcast_to(np.array(plain, np.float32), (WIDTH_SUN // 2, WIDTH_SUN, 3)).copy()
    else:
        image = _rendered(world, WIDTH_SUN if sun else WIDTH, selection.frames[0], notes)
        image = _positive(image, world, notes)
        what = f"an environment map of {image.shape[1]}x{image.shape[0]}"
        notes.add("baked", world.name, "World", what, "detail is limited to its pixels")
    if sun is not None:
        least = _narrowest(image.shape[1])
        if sun.angle < least:
            angle, shown = (f"{math.degrees(a):.2g} degrees" for a in (sun.angle, least))
            what, effect = f"its angle of {angle} is {shown} in the environment map", "its shadows are softer"
            notes.add("approximated", sun.name, "Angle", what, effect)
        image += sun_disc(sun, image.shape[1])
    write_exr(folder / FILE, image)
    return [plugin("emitter", "envmap", filename=FILE, to_world=np.linalg.inv(LOCAL_FROM_WORLD))]


def sun_disc(sun: Sun, width: int) -> F32:
    """Radiance (width / 2, width, 3) of a sun's disc, whose irradiance is that of the lamp.

    Pixels at its edge hold the part of them that is covered, of 8x8 points.
    """
    half = 0.5 * max(sun.angle, _narrowest(width))
    height, fine = width // 2, 8
    toward = sun.direction
    row = math.acos(float(np.clip(toward[2], -1.0, 1.0))) / math.pi * height
    margin = half / math.pi * height + 2.0
    rows = np.arange(max(int(row - margin), 0), min(int(row + margin) + 1, height))
    v = ((rows[:, None] + (np.arange(fine) + 0.5) / fine) / height).reshape(-1)
    cosine = _cosine(v, (np.arange(width * fine) + 0.5) / (width * fine), toward)
    inside = (cosine > math.cos(half)).reshape(len(rows), fine, width, fine).mean(axis=(1, 3))
    solid_angle = 2.0 * (math.pi / height) ** 2 * np.sin((rows + 0.5) / height * math.pi) / 2.0
    of_pixels = _cosine((rows + 0.5) / height, (np.arange(width) + 0.5) / width, toward)
    weight = float((inside * solid_angle[:, None] * np.maximum(of_pixels, 0.0)).sum())
    image = np.zeros((height, width, 3), np.float32)
    image[rows] = inside[..., None] * np.array(sun.irradiance) / max(weight, 1e-12)
    return image


def _narrowest(width: int) -> float:
    """Least angle of a sun's disc: two pixels."""
    return 4.0 * math.pi / width


def _cosine(v: np.ndarray, u: np.ndarray, toward: np.ndarray) -> np.ndarray:
    """Cosines (V, U) between a direction and those of coordinates of the map, 0..1."""
    polar, turn = v[:, None] * math.pi, u[None, :] * 2.0 * math.pi
    cosine: np.ndarray = np.cos(polar) * toward[2]
    return cosine + np.sin(polar) * (np.sin(turn) * toward[0] + np.cos(turn) * toward[1])


def _plain(world: Any, notes: Notes) -> tuple[float, float, float] | None:
    """Radiance of a world of one colour; None for one with textures."""
    if world is None:
        return 0.0, 0.0, 0.0
    if not world.use_nodes or world.node_tree is None:
        r, g, b = world.color
        return float(r), float(g), float(b)
    output = world.node_tree.get_output_node("CYCLES")
    if output is None:
        return 0.0, 0.0, 0.0
    shader = Graph(world.name, notes).shader(output.inputs["Surface"], ())
    if isinstance(shader, Nothing):
        return 0.0, 0.0, 0.0
    if not isinstance(shader, Emission):
        return None
    colour, strength = shader.colour, shader.strength
    if not (isinstance(colour, Constant) and isinstance(strength, Constant)):
        return None
    r, g, b = (c * strength.number for c in colour.colour)
    return r, g, b


def _positive(radiance: np.ndarray, world: Any, notes: Notes) -> np.ndarray:
    """The radiance; what is negative is 0, with a note."""
    if (radiance < 0.0).any():
        what, effect = "its negative light is left out", "surfaces are brighter: Blender takes light away"
        notes.add("not-carried", world.name, "World", what, effect)
    return np.maximum(radiance, 0.0)


def _rendered(world: Any, width: int, frame: int, notes: Notes) -> F32:
    """Radiance of a world at a frame, from north at the left edge over east, zenith on top."""
    nodes = [node for tree in trees(world.node_tree) for node in tree.nodes]
    images = [node.image for node in nodes if node.type in IMAGES and node.image]
    width = min(max([width, *(image.size[0] for image in images)]), WIDTH_MAX)
    has_sky = any(node.type == "TEX_SKY" for node in nodes)
    width = max(width, WIDTH_SUN) if has_sky else width
    scene = bpy.data.scenes.new("enfilade world")
    scene.world = _for_light(world, notes)
    scene.frame_set(frame)
    camera = bpy.data.cameras.new("enfilade world")
    camera.type = "PANO"
    (camera if hasattr(camera, "panorama_type") else camera.cycles).panorama_type = "EQUIRECTANGULAR"
    eye = bpy.data.objects.new("enfilade world", camera)
    eye.rotation_euler = (math.pi / 2.0, 0.0, 0.0)  # looks north, +y
    scene.collection.objects.link(eye)
    scene.camera = eye
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, width // 2, 100
    settings = render.image_settings
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGB"
    file = Path(bpy.app.tempdir, "world.exr")  # Blender takes braces in a path for a template
    render.filepath = str(file)
    cycles = scene.cycles
    cycles.samples = SAMPLES_SKY if has_sky else SAMPLES
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    cycles.pixel_filter_type, cycles.sample_clamp_direct = "BOX", 0.0
    bpy.ops.render.render(write_still=True, scene=scene.name)
    image = bpy.data.images.load(str(file))
    image.colorspace_settings.name = "Non-Color"
    pixels = linear_pixels(image)[..., :3]
    bpy.data.images.remove(image)
    bpy.data.worlds.remove(scene.world)
    bpy.data.scenes.remove(scene)
    file.unlink()
    return np.roll(pixels, -(width // 2), axis=1)


def _for_light(world: Any, notes: Notes) -> Any:
    """A copy of a world as diffuse light sees it: no ray is one of the camera, which may see it."""
    copy = world.copy()
    copy.cycles_visibility.camera = True
    for link in (link for tree in trees(world.node_tree) for link in tree.links):
        node, output = link.from_node, link.from_socket.name
        if node.type == "LIGHT_PATH" or output in VIEW_SOCKETS.get(node.type, ()):
            what, effect = f"{output} is left out", "the camera sees the world that lights the scene"
            notes.add("approximated", world.name, node.name, what, effect)
    for node in put_stand_ins(copy.node_tree):
        name = node.image.name if node.image is not None else "none"
        what, effect = f"the image {name} {fault(node.image)}", "a mid grey is in its place"
        notes.add("approximated", world.name, node.name, what, effect)
    return copy


def _note_world(selection: Selection, notes: Notes) -> None:
    scene, world = selection.scene, selection.world
    if scene.render.film_transparent:
        effect = "the world is seen where the film would be transparent"
        notes.add("not-carried", scene.name, "Film: Transparent", "the background is opaque", effect)
    if world is None:
        return
    effect = "the world is seen by all rays"
    note_rays(world.name, world.cycles_visibility, RAYS_OF_WORLDS, effect, notes, prefix="")
    if not world.use_nodes or world.node_tree is None:
        return
    if any(node.type == "OUTPUT_WORLD" and node.inputs["Volume"].is_linked for node in world.node_tree.nodes):
        notes.add("not-carried", world.name, "Volume", "the world's volume is left out", "there is no fog")
