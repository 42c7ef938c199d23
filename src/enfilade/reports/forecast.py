"""How far a run has come, and how long the rest will take, from its ledger."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

__all__ = ["Forecast", "Step", "forecast", "wall_s"]

RECENT = 20  # units from which the pace is taken: scenes are not equally dear everywhere
TWICE = {  # methods that make each frame in two goes: what the first makes, and what the second does
    "paper": ("in-between", "antialiasing"),
    "decoupled": ("shaded frame", "the average over time"),
}


@dataclass(frozen=True)
class Step:
    """A kind of work.

    Attributes
    ----------
    name : str
    done : int
    total : int or None
        None where it is not known beforehand.
    wall_s : float
        Spent on it.
    """

    name: str
    done: int
    total: int | None
    wall_s: float


@dataclass(frozen=True)
class Forecast:
    """How far a run has come.

    Attributes
    ----------
    steps : tuple of Step
        In order.
    left_s : float or None
        Wall-clock seconds until the last frame at the present pace, by those who are at work; by one worker
        where nobody is. None where it can't be known yet.
    text : str
        What it rests on, or why it isn't known.
    """

    steps: tuple[Step, ...]
    left_s: float | None
    text: str


def forecast(
    identity: Mapping[str, Any], lines: Sequence[Mapping[str, Any]], *, workers: int = 1
) -> Forecast:
    """Tell how far a run has come.

    Frames of `paper` that repeat another, while the camera rests, count as in-betweens where they are left.

    Parameters
    ----------
    identity
        As ``run.json`` has it.
    lines
        Of the ledger.
    workers
        How many units are done at once; 0: nobody is at work.
    """
    work = _Work(identity, lines, workers)
    steps = tuple(work.steps())
    left, text = work.left()
    return Forecast(steps, left, text)


class _Work:
    def __init__(self, identity: Mapping[str, Any], lines: Sequence[Mapping[str, Any]], workers: int) -> None:
        self._workers = workers
        self._method = identity["method"]
        self._numbers = identity["path"]["frames"]
        self._units: dict[str, list[Mapping[str, Any]]] = {}
        for line in lines:
            self._units.setdefault(line["unit"].partition(" ")[0], []).append(line)

    @property
    def _raws(self) -> int:
        """Frames before the last step: `decoupled` shades a view at which the camera rests once."""
        if self._method != "decoupled":
            return len(self._numbers)
        return next(
            (line["views"] for line in self._units.get("survey", []) if "views" in line), len(self._numbers)
        )

    def steps(self) -> list[Step]:
        count = len(self._numbers)
        totals: dict[str, tuple[str, int | None]] = {"survey": ("path surveyed", 1)}
        if self._method == "paper":
            totals |= {"keyframe": ("keyframes", None), "segment": ("segments judged", None)}
            totals |= {"raw": ("frames before antialiasing", count)}
        if self._method == "decoupled":
            totals |= {"draft": ("drafts of keyframes", None), "cells": ("cells beside the drafts", None)}
            totals |= {"pilot": ("pilots", None), "keyframe": ("keyframes", None)}
            totals |= {"light": ("segments lit", None), "raw": ("frames shaded", self._raws)}
        last = {"frame": ("frames", count), "clip": ("clips of the video", None), "video": ("video", 1)}
        extra = {name: (name, None) for name in self._units if name not in totals and name not in last}
        ordered = [*totals.items(), *extra.items(), *last.items()]
        return [
            Step(title, len(self._units.get(kind, [])), total, self._spent(kind))
            for kind, (title, total) in ordered
        ]

    def left(self) -> tuple[float | None, str]:
        """Seconds left, and what they rest on."""
        frames = self._left_of("frame")
        if frames == 0.0:
            return 0.0, "all frames are finished"
        if self._method not in TWICE:
            if frames is None:
                return None, "the time left is known once the first frame is finished"
            return frames, self._basis("frame", "frames")
        first, second = TWICE[self._method]
        raw, share = self._left_of("raw"), self._judged_share()
        if raw is None:
            unknown = f"the time left is known once the first {first} is finished"
            if share == 0.0:
                return None, unknown
            spent = self._spent("keyframe") + self._spent("segment")
            return None, f"{100.0 * share:.0f} % of the path is judged, which took {spent:.0f} s; {unknown}"
        if frames is None and raw == 0.0:
            return None, f"only {second} is left; its time is known once the first frame is finished"
        rest = "" if frames is not None else f", {second} left out: no frame tells yet what it costs"
        kind, noun = ("raw", f"{first}s") if raw > 0.0 else ("frame", "frames")
        return raw + (frames or 0.0), self._basis(kind, noun) + rest

    def _basis(self, kind: str, noun: str) -> str:
        basis = f"at the pace of the last {min(RECENT, self._done(kind))} {noun}"
        match self._workers:
            case 0:
                return f"{basis}, one after the other"
            case 1:
                return basis
            case count:
                return f"{basis}, {count} at a time"

    def _done(self, kind: str) -> int:
        return len(self._units.get(kind, []))

    def _spent(self, kind: str) -> float:
        return sum(wall_s(line) for line in self._units.get(kind, []))

    def _left_of(self, kind: str) -> float | None:
        left = (self._raws if kind == "raw" else len(self._numbers)) - self._done(kind)
        if left <= 0:
            return 0.0
        recent = [wall_s(line) for line in self._units.get(kind, []) if not _is_given(line)][-RECENT:]
        rounds = math.ceil(left / max(self._workers, 1))
        return rounds * sum(recent) / len(recent) if recent else None

    def _judged_share(self) -> float:
        """Share of the path in segments that are not split any more."""
        judged: set[int] = set()
        for line in self._units.get("segment", []):
            if not line["verdict"]["is_split"]:
                judged |= {n for n in self._numbers if line["first"] <= n <= line["last"]}
        return len(judged) / max(len(self._numbers), 1)


def wall_s(line: Mapping[str, Any]) -> float:
    """Wall-clock seconds that a unit took, by its line of the ledger."""
    return sum(float(stage["wall_s"]) for stage in line.get("cost", {}).values())


def _is_given(line: Mapping[str, Any]) -> bool:
    # A keyframe of `paper` becomes a frame at no cost, and so does one that repeats another while the camera
    # rests: they say nothing about the in-betweens that are left, each of which is warped.
    return line["unit"].startswith("raw ") and "sources" in line and "warp" not in line["cost"]
