"""Images and videos <-> files: OpenEXR, pictures, image sequences and encoded video."""

from __future__ import annotations

from enfilade.images.codecs import video_suffix
from enfilade.images.encode import check_encodable, encode_video, exact_fps
from enfilade.images.exr import read_attributes, read_exr, write_exr
from enfilade.images.join import join_videos
from enfilade.images.sequence import Sequence, files_of, open_sequence

__all__ = [
    "Sequence",
    "check_encodable",
    "encode_video",
    "exact_fps",
    "files_of",
    "join_videos",
    "open_sequence",
    "read_attributes",
    "read_exr",
    "video_suffix",
    "write_exr",
]
