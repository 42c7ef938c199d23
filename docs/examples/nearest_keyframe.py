"""Example of a method: every frame is reprojected from its nearest keyframe.

Keyframes are path traced. A pixel of another frame takes the colour of the keyframe's pixel that shows the
same point. Where the keyframe shows another surface (a disocclusion), and in the sky, the pixel is path
traced. Highlights and reflections of reused pixels are those of the keyframe. With this folder in
``PYTHONPATH``:

    enfilade render scene.xml --path path.json --out run --method nearest_keyframe:NearestKeyframe
"""

import numpy as np

from enfilade import Method
from enfilade.gbuffer import positions
from enfilade.methods.analysis import keyframes_of
from enfilade.methods.base import FRAMES, Output, Pass, Task, TaskId
from enfilade.records import Frame, Provenance
from enfilade.renderer import PixelFilter, Purpose
from enfilade.settings import KeyframeSettings, SamplingSettings, TraceSettings

DEPTH_TOLERANCE = 0.05  # of the depth, within which a keyframe's pixel shows the same surface


class NearestKeyframe(Method):
    """Frames reprojected from the nearest keyframe."""

    name = "nearest-keyframe"
    settings = (TraceSettings, SamplingSettings, KeyframeSettings)
    passes = (Pass("keyframes", Frame), Pass(FRAMES, Frame, reads=("keyframes",)))

    def keyframes(self, analysis):
        """Initial keyframes of all shots."""
        return [frame for segments in analysis.segments() for frame in keyframes_of(segments)]

    def tasks(self, analysis):
        """A task for each keyframe, and one for each frame, which needs the nearest keyframe of its shot."""
        shots = zip(analysis.path.shots(), analysis.segments(), strict=True)
        for number, (frames, segments) in enumerate(shots):
            keyframes = np.array(keyframes_of(segments))
            yield from (Task("keyframes", int(frame), number) for frame in keyframes)
            for frame in frames:
                nearest = int(keyframes[np.abs(keyframes - frame).argmin()])
                yield Task(FRAMES, frame, number, (TaskId("keyframes", nearest),))

    def run(self, task, inputs, walk):
        """Trace a keyframe, or reproject a frame and trace its disocclusions."""
        geometry = walk.view(task.frame).geometry
        if not task.needs:
            everywhere = np.ones(geometry.shape_index.shape, bool)
            return completed(walk, task.frame, np.zeros_like(geometry.albedo), everywhere, Purpose.KEYFRAME)
        nearest = task.needs[0].frame
        keyframe = inputs.record("keyframes", nearest)
        if task.frame == nearest:
            return Output({task.frame: keyframe})
        row, column, is_visible = find_in(walk.view(nearest).geometry, geometry)
        return completed(walk, task.frame, keyframe.color[row, column], ~is_visible, Purpose.FILL)


def completed(walk, frame, color, where, purpose):
    """An image whose pixels of a mask are path traced, through their centres as the G-buffer."""
    spp = walk.settings[SamplingSettings].spp
    traced = walk.trace(frame, purpose, spp=spp, pixel_filter=PixelFilter.CENTRE, where=where)
    color[where] = traced.color
    origin = Provenance.KEYFRAME if purpose == Purpose.KEYFRAME else Provenance.DISOCCLUDED
    provenance = np.where(where, origin, Provenance.REUSED).astype(np.uint8)
    return Output({frame: Frame(color, provenance)}, {"dropped": traced.dropped})


def find_in(keyframe, geometry):
    """Row and column, (H, W), at which a keyframe may show the points of a frame, and whether it does."""
    camera = keyframe.camera
    x, y, depth = np.moveaxis((positions(geometry) - camera.eye) @ camera.pixel_from_direction.T, -1, 0)
    is_ahead = geometry.is_hit & (depth > 0.0)
    column, row = (np.floor(np.where(is_ahead, v, -1.0) / np.where(is_ahead, depth, 1.0)) for v in (x, y))
    is_visible = (column >= 0) & (row >= 0) & (column < camera.width) & (row < camera.height)
    column, row = (np.where(is_visible, v, 0).astype(int) for v in (column, row))
    is_visible &= keyframe.shape_index[row, column] == geometry.shape_index
    is_visible &= np.abs(keyframe.depth[row, column] - depth) <= DEPTH_TOLERANCE * depth
    return row, column, is_visible
