"""Cameras, and camera paths: nerfstudio's camera_path.json, our own keyed poses, and selections of frames."""

from enfilade.camera.frames import parse_frames, ranges
from enfilade.camera.load import check_size, load_path
from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera

__all__ = ["Camera", "CameraPath", "check_size", "load_path", "parse_frames", "ranges"]
