"""COURTYARD: arcades around an open court under sun and sky.

Columns, foliage and lattices throw sharp shadows; the arcades are lit by what the court reflects. A basin of
water mirrors the sky, glazed doors mirror the court. x runs east, y north. No constant of enfilade was chosen
on this scene.
"""

from __future__ import annotations

from studies.scenes import courtyard_contents, courtyard_shell, textures
from studies.scenes.materials import Material
from studies.scenes.presets import Preset
from studies.scenes.walk import Walk
from studies.scenes.writer import SceneWriter

FINISHES = {
    "plaster": Material("matte", "#e6d2ae"),
    "joinery": Material("pbr", "#4f7c78", 0.4),
    "soil": Material("matte", "#4a382a"),
    "bark": Material("matte", "#6d5540"),
    "leaf": Material("satin", "#57803f", 0.25),
    "leaf-dark": Material("satin", "#3d6636", 0.2),
    "terracotta": Material("matte", "#b9693f"),
    "glaze-blue": Material("polished", "#2c5f92"),
    "enamel-white": Material("pbr", "#eeeae0", 0.2, clearcoat=1.0),
    "orange": Material("satin", "#e0872a", 0.25),
    "iron": Material("pbr", "#37383b", 0.5, metallic=0.8),
    "copper": Material("pbr", "#c98a63", 0.25, metallic=1.0),
    "brass": Material("metal", "#d9b468", 0.15),
    "water": Material("polished", "#16343a"),
    "dark": Material("matte", "#14120f"),
    "glow": Material("matte", "#ffffff"),
    "glass-pane": Material("pane", "#eef5f3"),
    "glass": Material("glass"),
}


def furnish(writer: SceneWriter, preset: Preset) -> None:
    """Build the whole courtyard."""
    _materials(writer, preset)
    courtyard_shell.add_floors(writer)
    courtyard_shell.add_walls(writer)
    courtyard_shell.add_arcades(writer, preset)
    courtyard_shell.add_doors(writer)
    courtyard_shell.add_daylight(writer, preset)
    courtyard_contents.add_basin(writer, preset)
    courtyard_contents.add_plants(writer, preset)
    courtyard_contents.add_table(writer, preset)
    courtyard_contents.add_lanterns(writer, preset)


def walk(preset: Preset) -> tuple[Walk, int]:
    """Return the camera's walk and its number of frames."""
    stations = [
        ((1.25, 3.3, 1.60), (6.6, 5.6, 1.05)),
        ((1.6, 4.4, 1.60), (7.6, 6.4, 1.10)),
        ((2.5, 5.4, 1.59), (8.6, 7.2, 1.15)),
        ((3.7, 6.0, 1.58), (9.4, 7.8, 1.20)),
        ((4.9, 6.9, 1.57), (10.2, 8.2, 1.20)),
        ((6.3, 7.5, 1.56), (11.6, 7.0, 1.25)),
        ((7.7, 7.3, 1.57), (12.4, 5.4, 1.25)),
        ((8.6, 6.5, 1.58), (11.8, 3.6, 1.20)),
    ]
    if preset.is_small:
        return Walk(stations[:4], [(0.0, 0.5), (1.0, 1.0)], reach=0.8, fov_deg=54.0), 60
    pace = [
        (0.0, 0.02),
        (0.06, 0.02),
        (0.2, 0.9),
        (0.5, 0.9),
        (0.6, 0.06),
        (0.68, 0.06),
        (0.8, 0.9),
        (1.0, 0.05),
    ]
    return Walk(stations, pace, fov_deg=54.0), 300


def _materials(writer: SceneWriter, preset: Preset) -> None:
    """Declare every finish of the courtyard."""
    big, mid = preset.texture, preset.texture // 2
    for name, material in FINISHES.items():
        writer.material(name, material)
    images = {
        "paving": (textures.paving(big, ("#d9cbb0", "#8c8273", "#b3906a"), 7), "matte"),
        "ashlar": (textures.ashlar(mid, "#dbc8a4", "#a8977a", 6, 8), "matte"),
        "timber": (textures.wood(mid, "#4d3421", "#8a6240", 6), "matte"),
        "cloth": (textures.gingham(mid, "#b0473b", "#efe6d6", 8), "matte"),
        "tiles": (textures.glazed(mid, "#e7e3d3", "#2f5c8a", "#c98f35"), "polished"),
    }
    for name, (image, finish) in images.items():
        writer.material(name, Material(finish, writer.texture(name, image)))
    quarry = writer.texture("quarry", textures.chequer(big, ("#b4714d", "#94573b"), 8, 9))
    writer.material("quarry", Material("satin", quarry, 0.22))
    marble = writer.texture("marble", textures.veined(mid, "#e3dccd", "#a39b8d", 14))
    writer.material("marble", Material("satin", marble, 0.15))
    oak = writer.texture("oak", textures.wood(mid, "#8a6540", "#c59a68", 9))
    writer.material("oak", Material("pbr", oak, 0.5))
