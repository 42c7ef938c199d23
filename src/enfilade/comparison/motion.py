"""Sources of the motion vectors of a compared sequence: layers of its frames, an estimate, or none."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from enfilade.comparison.matching import is_exr
from enfilade.comparison.optical_flow import FlowEstimator
from enfilade.comparison.pairs import Pair
from enfilade.errors import ImageError
from enfilade.images import Sequence
from enfilade.metric.transient import moved
from enfilade.records import F32, U8, Flow

Layers = Mapping[str, npt.NDArray[Any]]
FlowChoice: TypeAlias = Literal["auto", "layers", "estimate", "none"]

CUT_DIFFERENCE = 0.1  # mean change of encoded luminance, 0..1, along the motion where it is known: a cut
RESTING_DIFFERENCE = 0.02  # ... where backward motion is known to be none: in a shot, the camera rests
BLOCK_PX = 8  # over which it is averaged: noise is no cut


@dataclass(frozen=True, eq=False)
class Moved:
    """The motion of the image at one frame.

    Attributes
    ----------
    motion : (H, W, 2) float32 or None
        Mean of the motion since the last frame and until the next, pixels per frame, x right, y down;
        None: nothing moves.
    backward : (H, W, 2) float32 or None
        To the last frame, pixels; None where nothing moves or there is none.
    forward : (H, W, 2) float32 or None
        To the next frame, pixels; None where it is unknown, or less exact than the outline of an object.
    is_cut : bool
        Whether a new shot begins.
    """

    motion: F32 | None = None
    backward: F32 | None = None
    forward: F32 | None = None
    is_cut: bool = False


class Motion(Protocol):
    """Gives each pair of frames its flow.

    Attributes
    ----------
    kind : str
        ``layers``, ``estimate`` or ``none``.
    text : str
        One line for the log.
    """

    kind: str
    text: str

    def follow(self, pairs: Iterable[Pair]) -> Iterator[tuple[Pair, Moved]]:
        """Pairs in order, each with its motion."""
        ...


def open_motion(
    test: Sequence, reference: Sequence, choice: FlowChoice, starts: frozenset[int] | None = None
) -> Motion:
    """Choose the source of flow: layers of the reference, of the test, else an estimate.

    Parameters
    ----------
    test, reference
    choice
        ``auto`` takes layers where there are some and estimates otherwise.
    starts
        Indices of the frames that do not follow the one before; None: the flow and the images tell.

    Raises
    ------
    ImageError
        Layers are asked for, and neither sequence has any that are known.
    """
    if choice in ("auto", "layers"):
        for sequence, role in ((reference, "reference"), (test, "test")):
            kind = _kind_of(sequence)
            if kind is not None:
                return _FromLayers(sequence, kind, role, starts)
    if choice == "layers":
        raise ImageError(
            f"neither {reference.name(0)} nor {test.name(0)} has layers of motion vectors; known are: "
            f"{'; '.join(kind.text for kind in KINDS)}. --flow estimate needs none"
        )
    if choice == "none":
        return _Still("motion vectors: none; the sequences are compared as static", starts)
    if len(reference) == 1:
        return _Still("motion vectors: none in a single image; it is compared as static", starts)
    return _Estimated(reference.width, reference.height, starts)


@dataclass(frozen=True)
class _Kind:
    text: str
    read: Callable[[Layers], Flow | None]
    is_forward_only: bool = False  # backward motion is taken to be the opposite


def _flow(backward: npt.NDArray[Any], forward: npt.NDArray[Any]) -> Flow:
    # A frame without a neighbour in its shot has zeros for the flow to it.
    return Flow(
        np.ascontiguousarray(backward, np.float32),
        np.ascontiguousarray(forward, np.float32),
        bool(backward.any()),
        bool(forward.any()),
    )


def _own(layers: Layers) -> Flow | None:
    backward, forward = layers.get("backward"), layers.get("forward")
    if backward is None or forward is None or not backward.shape == forward.shape == (*backward.shape[:2], 2):
        return None
    return _flow(backward, forward)


def _blender(layers: Layers) -> Flow | None:
    # Cycles (kernel/geom, primitive_motion_vector): X Y is where the point was minus where it is, Z W is
    # where it is minus where it will be, in pixels, y up.
    name = next((n for n in layers if n == "Vector" or n.endswith(".Vector")), None)
    if name is None or f"{name}.W" not in layers or layers[name].ndim != 3:
        return None
    x, y, z = np.moveaxis(layers[name].astype(np.float32), -1, 0)
    w = layers[f"{name}.W"].astype(np.float32)
    return _flow(np.stack([x, -y], axis=-1), np.stack([-z, w], axis=-1))


def _plain(layers: Layers) -> Flow | None:
    forward = layers.get("motion")
    if forward is None or forward.ndim != 3 or forward.shape[2] != 2:
        return None
    return _flow(-forward, forward)  # what comes to a pixel moved as what goes from it


KINDS = (
    _Kind("forward.u/v and backward.u/v (pixels to the next and previous frame, x right, y down)", _own),
    _Kind("Vector.X/Y/Z/W (Blender's Vector pass)", _blender),
    _Kind("motion.u/v (pixels to the next frame, x right, y down)", _plain, is_forward_only=True),
)


def _kind_of(sequence: Sequence) -> _Kind | None:
    if not is_exr(sequence):
        return None
    layers = sequence.layers(0)
    return next((kind for kind in KINDS if kind.read(layers) is not None), None)


def _blocks(image: F32) -> F32:
    rows, columns = (min(n, BLOCK_PX) for n in image.shape)
    height, width = (n - n % block for n, block in zip(image.shape, (rows, columns), strict=True))
    blocks = image[:height, :width].reshape(height // rows, rows, width // columns, columns)
    return np.asarray(blocks.mean(axis=(1, 3)), np.float32)


def _change(image: F32, before: F32) -> float:
    """Mean change of blocks since the last frame."""
    return float(np.abs(_blocks(image - before)).mean())


def _change_along(image: F32, before: F32, backward: F32) -> float:
    """Mean change of blocks since the last frame, fetched along a flow, where that stays in the image.

    Where it stays nowhere, that of the same place.
    """
    fetched, is_inside = moved(before, backward)
    covered = float(_blocks(is_inside.astype(np.float32)).mean())
    change = _blocks(np.where(is_inside, image - fetched, np.float32(0.0)))
    return float(np.abs(change).mean()) / covered if covered else _change(image, before)


def _apart(flow: Flow, earlier: Flow) -> tuple[Flow, Flow]:
    """Flow of the first frame of a shot, and of the last of the one before, without that across the cut."""
    none = np.zeros_like(flow.backward)
    return (
        replace(flow, backward=none, has_backward=False),
        replace(earlier, forward=none, has_forward=False),
    )


class _FromLayers:
    kind = "layers"

    def __init__(self, sequence: Sequence, kind: _Kind, role: str, starts: frozenset[int] | None) -> None:
        self._sequence = sequence
        self._kind = kind
        self._starts = starts
        self.text = f"motion vectors: from the {role}'s layers {kind.text}"

    def follow(self, pairs: Iterable[Pair]) -> Iterator[tuple[Pair, Moved]]:
        """Pairs with the flow of their layers, one frame after they came.

        Where no run tells, a cut is where the image changes altogether along the motion: renderers also write
        motion vectors across cuts.
        """
        waiting: tuple[Pair, Flow, bool] | None = None
        last: Flow | None = None
        for pair in pairs:
            read = flow = self._read(pair.index)
            if self._kind.is_forward_only and last is not None and not flow.has_forward:
                # The last frame of a shot tells no motion: what came to it moved as in the frame before.
                flow = replace(flow, backward=last.backward, has_backward=last.has_backward)
            last = read
            is_cut = False
            if waiting is not None:
                _, earlier, was_cut = waiting
                is_cut = self._is_cut(pair.index, flow, pair.reference_grey, waiting[0].reference_grey)
                if is_cut and self._has_unknown_cuts:
                    flow, earlier = _apart(flow, earlier)
                yield waiting[0], self._moved(earlier, is_cut=was_cut)
            waiting = pair, flow, is_cut
        if waiting is not None:
            yield waiting[0], self._moved(waiting[1], is_cut=waiting[2])

    def _moved(self, flow: Flow, *, is_cut: bool) -> Moved:
        # Vectors that lead one way are too inexact the other way for a test of disocclusion.
        forward = flow.forward if flow.has_forward and not self._kind.is_forward_only else None
        return Moved(flow.motion, None if is_cut else flow.backward, forward, is_cut)

    @property
    def _has_unknown_cuts(self) -> bool:
        """Whether flow in both directions may lead across a cut."""
        return self._starts is None and not self._kind.is_forward_only

    def _is_cut(self, index: int, flow: Flow, now: F32, before: F32) -> bool:
        if self._starts is not None:
            return index in self._starts
        is_at_rest = not flow.has_backward and not self._kind.is_forward_only
        return _change_along(now, before, flow.backward) > (
            RESTING_DIFFERENCE if is_at_rest else CUT_DIFFERENCE
        )

    def _read(self, index: int) -> Flow:
        name = self._sequence.name(index)
        flow = self._kind.read(self._sequence.layers(index))
        if flow is None:
            raise ImageError(f"{name} has no layers {self._kind.text}, which the first frame has")
        if not np.isfinite(flow.motion).all():
            raise ImageError(
                f"{name} has NaN or infinite values in its motion vectors; --flow estimate needs none of it"
            )
        if self._starts is None:
            return flow
        # The camera may rest: a neighbour of the same pose has no motion, and counts.
        before, after = (0 < i < len(self._sequence) and i not in self._starts for i in (index, index + 1))
        return replace(flow, has_backward=flow.has_backward or before, has_forward=flow.has_forward or after)


class _Estimated:
    kind = "estimate"

    def __init__(self, width: int, height: int, starts: frozenset[int] | None) -> None:
        self._estimator = FlowEstimator(width, height)
        self._starts = starts
        self.text = (
            "motion vectors: no layers of them, so they are estimated from the reference (dense inverse "
            "search); --flow none compares them as static"
        )

    def follow(self, pairs: Iterable[Pair]) -> Iterator[tuple[Pair, Moved]]:
        """Pairs with estimated flow, one frame after they came."""
        before = now = None
        waiting: Pair | None = None
        for pair in pairs:
            after = self._estimator.luma(pair.reference_grey)
            if waiting is not None and now is not None:
                yield waiting, self._moved(waiting.index, now, before, after)
            waiting, before, now = pair, now, after
        if waiting is not None and now is not None:
            yield waiting, self._moved(waiting.index, now, before, None)

    def _moved(self, index: int, now: U8, before: U8 | None, after: U8 | None) -> Moved:
        starts = self._starts or frozenset()
        previous = None if index in starts else before
        following = None if index + 1 in starts else after
        flow = self._estimator.flow(now, previous, following)
        is_cut = index > 0 and not flow.has_backward if self._starts is None else index in starts
        return Moved(flow.motion, flow.backward if flow.has_backward else None, is_cut=is_cut)


class _Still:
    kind = "none"

    def __init__(self, text: str, starts: frozenset[int] | None) -> None:
        self.text = text
        self._starts = starts

    def follow(self, pairs: Iterable[Pair]) -> Iterator[tuple[Pair, Moved]]:
        """Pairs without motion. Where no run tells, a cut is where the image changes altogether."""
        before: F32 | None = None
        for pair in pairs:
            now = pair.reference_grey
            yield pair, Moved(is_cut=self._is_cut(pair.index, now, before))
            before = now

    def _is_cut(self, index: int, now: F32, before: F32 | None) -> bool:
        if self._starts is not None:
            return index in self._starts
        return before is not None and _change(now, before) > CUT_DIFFERENCE
