"""GALLERY: a museum hall with a low sun behind slatted blinds, showcases, gilded frames and a mirror.

Stripes of shadow fall on floor, walls, a painting and pedestals, near the blinds and far from them. x runs
east along the hall, y north.
"""

from __future__ import annotations

from studies.scenes import gallery_contents, gallery_shell, pictures, textures
from studies.scenes.materials import Material
from studies.scenes.presets import Preset
from studies.scenes.walk import Walk
from studies.scenes.writer import SceneWriter

FINISHES = {
    "plaster": Material("matte", "#efebe1"),
    "wall-north": Material("matte", "#c6cdc5"),
    "joinery": Material("matte", "#e4ddcc"),
    "linen": Material("matte", "#cfc4ae"),
    "slat": Material("matte", "#ded6c4"),
    "slat-wood": Material("matte", "#a4744a"),
    "stone": Material("matte", "#d5cfc3"),
    "terracotta": Material("matte", "#b0633f"),
    "glaze-blue": Material("polished", "#2f5f95"),
    "glaze-green": Material("polished", "#4b7a56"),
    "steel-dark": Material("metal", "#6c6f73", 0.3),
    "gilt": Material("metal", "#d9ae62", 0.22),
    "brass": Material("metal", "#e0b865", 0.12),
    "steel": Material("mirror", "#cfd2d6"),
    "mirror": Material("mirror", "#e6eaea"),
    "glass-pane": Material("pane", "#f0f7f4"),
    "glass": Material("glass"),
}


def furnish(writer: SceneWriter, preset: Preset) -> None:
    """Build the whole hall."""
    _materials(writer, preset)
    gallery_shell.add_shell(writer)
    gallery_shell.add_windows(writer)
    gallery_shell.add_blinds(writer, preset)
    gallery_shell.add_daylight(writer, preset)
    gallery_contents.add_paintings(writer)
    gallery_contents.add_showcases(writer, preset)
    gallery_contents.add_pedestals(writer, preset)
    gallery_contents.add_furniture(writer, preset)


def walk(preset: Preset) -> tuple[Walk, int]:
    """Return the camera's walk and its number of frames."""
    stations = [
        ((1.2, 3.3, 1.62), (5.2, 5.6, 1.45)),
        ((2.4, 3.4, 1.62), (6.4, 5.7, 1.40)),
        ((3.7, 3.3, 1.62), (7.2, 5.8, 1.38)),
        ((5.2, 3.25, 1.60), (8.4, 6.0, 1.35)),
        ((6.3, 3.5, 1.58), (10.8, 4.6, 1.38)),
        ((7.3, 4.1, 1.58), (12.5, 3.7, 1.40)),
        ((8.2, 4.75, 1.58), (12.9, 3.2, 1.45)),
        ((8.9, 4.95, 1.58), (12.6, 1.6, 1.50)),
    ]
    if preset.is_small:
        return Walk(
            stations[3:6], [(0.0, 0.03), (0.25, 0.03), (0.6, 1.0), (1.0, 0.8)], reach=0.85, fov_deg=52.0
        ), 60
    pace = [(0.0, 1.0), (0.30, 1.0), (0.44, 0.06), (0.56, 0.06), (0.70, 1.0), (0.92, 1.0), (1.0, 0.1)]
    return Walk(stations, pace, fov_deg=52.0), 300


def _materials(writer: SceneWriter, preset: Preset) -> None:
    """Declare every finish of the hall."""
    big, mid = preset.texture, preset.texture // 2
    for name, material in FINISHES.items():
        writer.material(name, material)
    parquet = writer.texture("parquet", textures.parquet(big, "#8a5c36", "#cb9a64", 6, 3))
    writer.material("parquet", Material("satin", parquet, 0.16))
    walnut = writer.texture("walnut", textures.wood(mid, "#452b1c", "#7d563a", 5))
    writer.material("walnut", Material("satin", walnut, 0.2))
    marble = writer.texture("marble", textures.veined(mid, "#e7e2d8", "#8b8f92", 8))
    writer.material("marble", Material("polished", marble))
    images = {
        "painting-hills": pictures.landscape(mid),
        "painting-discs": pictures.composition(mid),
        "painting-stem": pictures.botanical(mid),
    }
    for name, image in images.items():
        writer.material(name, Material("matte", writer.texture(name, image)))
