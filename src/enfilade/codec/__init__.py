"""Records and layers of pixels <-> files: OpenEXR and JSON, each file whole or not there at all."""

from __future__ import annotations

from enfilade.codec.exr import read_attributes, read_exr, write_exr
from enfilade.codec.frames import (
    read_frame,
    read_light,
    read_parts,
    read_shading,
    write_frame,
    write_light,
    write_parts,
    write_result,
    write_shading,
)
from enfilade.codec.tables import read_arrays, write_arrays
from enfilade.codec.whole import read_json, sweep, whole_file, write_json

__all__ = [
    "read_arrays",
    "read_attributes",
    "read_exr",
    "read_frame",
    "read_json",
    "read_light",
    "read_parts",
    "read_shading",
    "sweep",
    "whole_file",
    "write_arrays",
    "write_exr",
    "write_frame",
    "write_json",
    "write_light",
    "write_parts",
    "write_result",
    "write_shading",
]
