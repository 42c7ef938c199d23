"""Pictures of imported scenes."""

from enfilade.camera import load_path
from enfilade.methods.walkthrough import Walkthrough
from enfilade.renderer import PixelFilter, Purpose
from enfilade.scene.opener import Scene
from enfilade.settings import Settings


def traced(folder, spp):
    """The first frame of a scene folder by path tracing, (H, W, 3)."""
    path, settings = load_path(folder / "camera_path.json"), Settings()
    walk = Walkthrough(path, settings, Scene(folder / "scene.xml").open(settings))
    return walk.trace(0, Purpose.REFERENCE, spp=spp, pixel_filter=PixelFilter.BOX).color
