"""ROOM: a furnished room of matte, chequered surfaces, with a walk of varying speed (§6).

The camera rests, crosses the room close to a hanging lamp, turns fast, and rests again. All
materials are diffuse. x runs east, y north; the windows look west.
"""

from __future__ import annotations

from studies.scenes import pictures, room_contents, room_shell, textures
from studies.scenes.materials import Material
from studies.scenes.presets import Preset
from studies.scenes.room_plan import BOOKS
from studies.scenes.walk import Walk
from studies.scenes.writer import SceneWriter

MATTE = {
    "plaster": "#e6e0d4",
    "joinery": "#e2dccd",
    "walnut-edge": "#5b3d29",
    "soot": "#2b2724",
    "curtain": "#b9573f",
    "sofa": "#3f6a6b",
    "gilt": "#b08a4a",
    "shade": "#2f5d57",
    "shade-cloth": "#f1d9b0",
    "bulb": "#fff3dd",
    "brass": "#a9864c",
    "terracotta": "#b5694a",
    "leaf": "#4c7040",
    "glaze-blue": "#39648c",
    "glaze-cream": "#e9dfc8",
    "glaze-ochre": "#cf9440",
    "orange": "#e08a2e",
    "earth": "#4a3a2c",
}


def furnish(writer: SceneWriter, preset: Preset) -> None:
    """Build the whole room."""
    _materials(writer, preset)
    room_shell.add_shell(writer)
    room_shell.add_lantern(writer)
    room_shell.add_windows(writer, preset)
    room_shell.add_hearth(writer, preset)
    room_contents.add_dining(writer, preset)
    room_contents.add_lamps(writer, preset)
    room_contents.add_seating(writer, preset)
    room_contents.add_library(writer)
    room_contents.furnish_east_wall(writer, preset)
    room_shell.dress_walls(writer)
    room_contents.add_plants(writer, preset)


def walk(preset: Preset) -> tuple[Walk, int]:
    """Return the camera's walk and its number of frames."""
    stations = [
        ((6.55, 0.62, 1.62), (2.6, 3.55, 0.98)),
        ((5.35, 0.72, 1.60), (2.0, 3.40, 1.08)),
        ((4.10, 1.00, 1.56), (1.3, 3.00, 1.20)),
        ((3.52, 1.95, 1.52), (1.0, 3.30, 1.22)),
        ((3.62, 2.95, 1.50), (2.9, 5.40, 1.28)),
        ((4.00, 3.75, 1.48), (5.7, 5.40, 1.34)),
        ((4.45, 4.20, 1.46), (7.1, 3.10, 1.05)),
        ((5.50, 4.42, 1.52), (4.9, 0.80, 0.85)),
        ((6.60, 4.75, 1.62), (2.7, 1.75, 0.90)),
    ]
    if preset.is_small:
        pace = [(0.0, 0.015), (0.27, 0.015), (0.62, 1.0), (0.80, 1.0), (1.0, 0.25)]
        return Walk(stations, pace, reach=0.29), 60
    pace = [
        (0.0, 0.022),
        (0.095, 0.022),
        (0.25, 0.45),
        (0.34, 0.42),
        (0.435, 0.018),
        (0.50, 0.018),
        (0.60, 1.0),
        (0.66, 1.0),
        (0.73, 0.15),
        (0.79, 0.9),
        (0.85, 0.7),
        (0.965, 0.02),
        (1.0, 0.02),
    ]
    return Walk(stations, pace), 448


def _materials(writer: SceneWriter, preset: Preset) -> None:
    """Declare every finish of the room; all of them are matte."""
    big, mid = preset.texture, preset.texture // 2
    for name, colour in MATTE.items():
        writer.material(name, Material("matte", colour))
    for k, colour in enumerate(BOOKS):
        writer.material(f"book-{k}", Material("matte", colour))
    images = {
        "floor": textures.chequer(big, ("#e6ddca", "#4d4a46"), 8, 11),
        "rug": textures.rug(big, ("#e8dabd", "#b0503b", "#2f5364", "#33303a")),
        "wallpaper": textures.trellis(mid, "#d9dcc5", "#a9b394", "#7f9173"),
        "tile": textures.glazed(mid, "#efe8d8", "#2f5d8c", "#c98b3c"),
        "cloth": textures.gingham(mid, "#b8433c", "#f4efe4", 2),
        "gingham-blue": textures.gingham(mid, "#3d628c", "#f2ede0", 4),
        "gingham-ochre": textures.gingham(mid, "#cf9440", "#f4ecd9", 3),
        "walnut": textures.wood(mid, "#4b2f1f", "#8a6142", 5),
        "oak": textures.wood(mid, "#8a6540", "#c59a68", 9),
        "painting-hills": pictures.landscape(mid),
        "painting-discs": pictures.composition(mid),
        "painting-stem": pictures.botanical(mid),
    }
    for name, image in images.items():
        writer.material(name, Material("matte", writer.texture(name, image)))
