"""Camera paths: nerfstudio's camera_path.json, our own keyed poses, and selections of frames."""

from enfilade.path.frames import parse_frames
from enfilade.path.load import load_path

__all__ = ["load_path", "parse_frames"]
