"""Videos and image sequences: encoded from finished frames, and read to be compared."""

from __future__ import annotations

from enfilade.video.codecs import video_suffix
from enfilade.video.encode import check_encodable, encode_video, exact_fps, join_videos
from enfilade.video.fence import FencedSequence
from enfilade.video.sequence import Sequence, files_of, open_sequence

__all__ = [
    "FencedSequence",
    "Sequence",
    "check_encodable",
    "encode_video",
    "exact_fps",
    "files_of",
    "join_videos",
    "open_sequence",
    "video_suffix",
]
