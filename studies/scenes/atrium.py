"""ATRIUM: a hall of two storeys with polished floor, mirrors, glass and metal (§6).

A steady walk past columns towards the stair. x runs east along the hall, y north.
"""

from __future__ import annotations

from studies.scenes import atrium_contents, atrium_shell, textures
from studies.scenes.materials import Material
from studies.scenes.presets import Preset
from studies.scenes.walk import Walk
from studies.scenes.writer import SceneWriter

FINISHES = {
    "plaster": Material("matte", "#efe9dc"),
    "stone-trim": Material("matte", "#e2d8c4"),
    "stucco": Material("matte", "#b9c6bd"),
    "carpet": Material("matte", "#8e2f33"),
    "leaf": Material("matte", "#4d7a3c"),
    "bark": Material("matte", "#6a5240"),
    "earth": Material("matte", "#43352a"),
    "cushion": Material("matte", "#2f5f6b"),
    "glow": Material("matte", "#ffffff"),
    "steel": Material("metal", "#c9ccd0", 0.12),
    "bronze": Material("metal", "#b98d5a", 0.18),
    "brass": Material("metal", "#e0b865", 0.10),
    "mirror": Material("mirror", "#e9ecec"),
    "glass": Material("pane", "#eef6f3"),
    "planter": Material("matte", "#4a5257"),
    "plinth": Material("polished", "#3c3b3d"),
}


def furnish(writer: SceneWriter, preset: Preset) -> None:
    """Build the whole hall."""
    _materials(writer, preset)
    atrium_shell.add_floors(writer)
    atrium_shell.add_walls(writer, preset)
    atrium_shell.add_roof(writer, preset)
    atrium_shell.add_columns(writer, preset)
    atrium_shell.add_stair(writer, preset)
    atrium_shell.add_railings(writer, preset)
    atrium_contents.add_mirrors(writer, preset)
    atrium_contents.add_lamps(writer, preset)
    atrium_contents.add_doors(writer)
    atrium_contents.add_sculpture(writer, preset)
    atrium_contents.add_planting(writer, preset)


def walk(preset: Preset) -> tuple[Walk, int]:
    """Return the camera's walk and its number of frames."""
    stations = [
        ((4.3, 13.0, 1.60), (13.0, 11.1, 2.25)),
        ((4.9, 11.2, 1.65), (14.0, 8.7, 2.5)),
        ((5.5, 8.8, 1.85), (15.0, 5.9, 2.85)),
        ((6.3, 6.2, 2.25), (15.8, 3.1, 3.15)),
        ((7.4, 4.0, 2.60), (16.4, 1.0, 3.25)),
    ]
    return Walk(stations, [(0.0, 1.0), (1.0, 1.0)], fov_deg=54.0), 60 if preset.is_small else 200


def _materials(writer: SceneWriter, preset: Preset) -> None:
    """Declare every finish of the hall."""
    big, mid = preset.texture, preset.texture // 2
    for name, material in FINISHES.items():
        writer.material(name, material)
    paving = textures.paving(big, ("#e3d8c4", "#47413c", "#b98a60"), 4)
    writer.material("floor", Material("polished", writer.texture("paving", paving)))
    green = writer.texture("green-marble", textures.veined(mid, "#2f4f46", "#c9d6c4", 8))
    writer.material("green-marble", Material("satin", green, 0.06))
    wall = writer.texture("ashlar", textures.ashlar(mid, "#dccfb6", "#a6977e", 4, 6))
    writer.material("ashlar", Material("matte", wall))
    steps = writer.texture("travertine", textures.veined(mid, "#e6dcc8", "#b8a88c", 15))
    writer.material("travertine", Material("matte", steps))
    oak = writer.texture("oak", textures.wood(mid, "#6b4529", "#a97b4e", 3))
    writer.material("oak", Material("matte", oak))
    writer.material("varnish", Material("satin", oak, 0.12))
