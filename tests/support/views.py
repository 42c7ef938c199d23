"""A configuration of OpenColorIO with a view that shows exposed values up to 8, as linear as it is simple."""

from __future__ import annotations

from pathlib import Path

WHITE = 8.0  # that the view Soft shows as white: what it shows is linear, an eighth of the exposed value
CONFIG = """ocio_profile_version: 2
search_path: ""
roles: {default: lin_rec709, scene_linear: lin_rec709}
displays:
  sRGB:
    - !<View> {name: Soft, colorspace: soft}
colorspaces:
  - !<ColorSpace> {name: lin_rec709}
  - !<ColorSpace>
    name: soft
    from_scene_reference: !<GroupTransform>
      children:
        - !<MatrixTransform> {matrix: [0.125, 0, 0, 0, 0, 0.125, 0, 0, 0, 0, 0.125, 0, 0, 0, 0, 1]}
        - !<ExponentWithLinearTransform> {gamma: 2.4, offset: 0.055, direction: inverse}
"""


def write_config(folder: Path) -> str:
    file = folder / "soft.ocio"
    file.write_text(CONFIG)
    return str(file)
