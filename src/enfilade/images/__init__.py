"""Images and videos <-> files: OpenEXR, display-referred images, image sequences and encoded video."""

from __future__ import annotations

from enfilade.images.codecs import video_suffix
from enfilade.images.encode import check_encodable, encode_video, exact_fps
from enfilade.images.exr import read_attributes, read_exr, write_exr
from enfilade.images.frames import (
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
from enfilade.images.join import join_videos
from enfilade.images.sequence import Sequence, files_of, open_sequence
from enfilade.images.tables import read_arrays, write_arrays

__all__ = [
    "Sequence", "check_encodable", "encode_video", "exact_fps", "files_of", "join_videos", "open_sequence",
    "read_arrays", "read_attributes", "read_exr", "read_frame", "read_light", "read_parts", "read_shading",
    "video_suffix", "write_arrays", "write_exr", "write_frame", "write_light", "write_parts", "write_result",
    "write_shading",
]  # fmt: skip
