"""View transforms in a comparison: OpenEXR frames are shown as the video of their run shows them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

from enfilade.comparison.matching import Side, is_exr
from enfilade.errors import SettingsError
from enfilade.images.view import open_view
from enfilade.kernels.tone import srgb_decode
from enfilade.records import F32
from enfilade.settings import VideoSettings

View: TypeAlias = Callable[[F32], F32]


def open_views(sides: Sequence[Side]) -> tuple[list[View | None], list[str]]:
    """Open the views of a comparison.

    A run has the view of its video. Frames of no run have that of the other side, and references share one.
    If a view can't be opened, as after a move of its configuration, all sides have the sRGB curve.

    Parameters
    ----------
    sides
        The test and its references.

    Returns
    -------
    views : list
        Of each side: from exposed linear Rec.709 to linear values on an sRGB display, 0..1. None: the frames
        are shown by the sRGB curve, which only clips.
    notes : list of str
        Remarks on other views than that.
    """
    test, *references = (side.sequence.view for side in sides)
    shared = next((view for view in references if view is not None), test)
    chosen = [shared if test is None else test, *[shared for _ in references]]
    of = {side.role: view for side, view in zip(sides, chosen, strict=True) if is_exr(side.sequence)}
    opened: dict[VideoSettings | None, View] = {}
    notes = []
    for view in dict.fromkeys(of.values()):
        if view is None or not view.ocio:
            continue
        roles = " and ".join(f"the {role}" for role in of if of[role] == view)
        name = f"the view {view.view or 'default'} of {view.ocio}"
        try:
            opened[view] = _shown(view)
        except SettingsError as error:
            return [None] * len(sides), [
                f"view: all sides: the sRGB curve, clipped at white, since {name} can't be opened: {error}"
            ]
        notes.append(f"view: {roles}: {name}, as in the video of the run")
    return [opened.get(of.get(side.role)) for side in sides], notes


def _shown(settings: VideoSettings) -> View:
    encode = open_view(settings, 0.0).encode
    return lambda exposed: srgb_decode(encode(exposed))
