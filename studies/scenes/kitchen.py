"""KITCHEN: coated, rough and metallic materials under many small lamps, at night.

No sun and no sky: pendants, strips below cupboards, discs in the ceiling and a spot light. x runs east,
y north.
"""

from __future__ import annotations

from studies.scenes import kitchen_contents, kitchen_shell, kitchen_units, textures
from studies.scenes.materials import Material
from studies.scenes.presets import Preset
from studies.scenes.walk import Walk
from studies.scenes.writer import SceneWriter

FINISHES = {
    "plaster": Material("matte", "#ece7da"),
    "paint": Material("pbr", "#efe8d8", 0.75),
    "joinery": Material("pbr", "#ece6d6", 0.4),
    "lacquer-white": Material("pbr", "#e6e2d8", 0.35),
    "lacquer-green": Material("pbr", "#6f917b", 0.45, clearcoat=0.6),
    "lacquer-cream": Material("pbr", "#e3d7b8", 0.3, clearcoat=0.8),
    "enamel-red": Material("pbr", "#a8372c", 0.25, clearcoat=1.0),
    "enamel-white": Material("pbr", "#eeeae0", 0.2, clearcoat=1.0),
    "enamel-black": Material("polished", "#26272a"),
    "glass-black": Material("polished", "#101114"),
    "fridge": Material("pbr", "#b9bcbd", 0.38, metallic=0.9),
    "copper": Material("pbr", "#d08a63", 0.22, metallic=1.0),
    "gold": Material("pbr", "#d6b25c", 0.3, metallic=1.0),
    "iron": Material("pbr", "#3c3c3f", 0.6, metallic=0.6),
    "brass": Material("metal", "#d9b468", 0.15),
    "steel-brushed": Material("metal", "#c4c6c8", 0.25),
    "chrome": Material("mirror", "#dfe2e4"),
    "porcelain": Material("polished", "#efece4"),
    "glaze-teal": Material("polished", "#2f7478"),
    "glaze-green": Material("polished", "#3f6a45"),
    "terracotta": Material("matte", "#b0653f"),
    "leaf": Material("satin", "#4b7a3c", 0.3),
    "orange": Material("satin", "#e0872a", 0.25),
    "pasta": Material("matte", "#dcb766"),
    "lentils": Material("matte", "#a4582f"),
    "flour": Material("matte", "#efe9dc"),
    "paprika": Material("matte", "#a5301c"),
    "night": Material("matte", "#0b1020"),
    "glow": Material("matte", "#ffffff"),
    "glass-pane": Material("pane", "#f4f8f7"),
    "glass": Material("glass"),
}


def furnish(writer: SceneWriter, preset: Preset) -> None:
    """Build the whole kitchen."""
    _materials(writer, preset)
    kitchen_shell.add_shell(writer)
    kitchen_shell.add_window(writer)
    kitchen_shell.add_lamps(writer, preset)
    kitchen_units.add_worktops(writer)
    kitchen_units.add_sink(writer, preset)
    kitchen_units.add_wall_cupboards(writer)
    kitchen_units.add_stove(writer, preset)
    kitchen_units.add_fridge(writer)
    kitchen_units.add_shelves(writer)
    kitchen_units.add_door(writer)
    kitchen_contents.add_dining(writer, preset)
    kitchen_contents.add_jars(writer, preset)
    kitchen_contents.add_worktop_things(writer, preset)
    kitchen_contents.add_shelf_things(writer, preset)
    kitchen_contents.add_plant(writer, preset)


def walk(preset: Preset) -> tuple[Walk, int]:
    """Return the camera's walk and its number of frames."""
    stations = [
        ((0.75, 2.35, 1.58), (3.5, 4.1, 1.05)),
        ((1.0, 3.0, 1.56), (4.3, 3.7, 1.02)),
        ((1.5, 3.45, 1.54), (4.6, 4.2, 1.02)),
        ((2.3, 3.5, 1.52), (5.4, 4.1, 1.05)),
        ((3.1, 3.40, 1.52), (6.2, 3.4, 1.12)),
        ((3.8, 3.15, 1.52), (6.1, 4.0, 1.12)),
        ((4.5, 2.70, 1.52), (4.9, 4.7, 1.08)),
        ((4.95, 2.15, 1.54), (3.4, 4.2, 1.02)),
        ((5.1, 1.60, 1.56), (2.0, 3.1, 0.98)),
    ]
    if preset.is_small:
        return Walk(stations[:4], [(0.0, 0.02), (0.2, 0.02), (0.6, 1.0), (1.0, 0.9)], fov_deg=52.0), 60
    pace = [
        (0.0, 0.02),
        (0.06, 0.02),
        (0.2, 0.9),
        (0.38, 0.9),
        (0.45, 0.08),
        (0.52, 0.08),
        (0.64, 0.9),
        (0.9, 0.9),
        (1.0, 0.05),
    ]
    return Walk(stations, pace, fov_deg=52.0), 300


def _materials(writer: SceneWriter, preset: Preset) -> None:
    """Declare every finish of the kitchen."""
    big, mid = preset.texture, preset.texture // 2
    for name, material in FINISHES.items():
        writer.material(name, material)
    floor = writer.texture("floor", textures.chequer(big, ("#ddd5c4", "#8b908b"), 6, 5))
    writer.material("floor", Material("satin", floor, 0.2))
    tiles = writer.texture("tiles", textures.ashlar(mid, "#e9ece6", "#9c9a92", 8, 4))
    writer.material("tiles", Material("polished", tiles))
    oak = writer.texture("oak", textures.wood(mid, "#8a6540", "#c59a68", 9))
    writer.material("oak", Material("matte", oak))
    writer.material("oak-varnished", Material("pbr", oak, 0.35, clearcoat=0.5))
    top = writer.texture("beech", textures.wood(mid, "#a06f43", "#cfa272", 4, 6))
    writer.material("worktop", Material("satin", top, 0.15))
