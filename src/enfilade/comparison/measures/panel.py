"""Who judges: the known judges by name, and which of them can be had here."""

from __future__ import annotations

from importlib.util import find_spec

from enfilade.comparison.measures.aqm import AqmJudge
from enfilade.comparison.measures.colorvideovdp import ColorVideoVdp
from enfilade.comparison.measures.flip import Flip
from enfilade.comparison.measures.judge import Judge, Scale
from enfilade.comparison.measures.psnr import Psnr
from enfilade.comparison.measures.temporal import Temporal
from enfilade.errors import SettingsError
from enfilade.metric import Pursuit
from enfilade.viewing import Viewing

__all__ = ["JUDGES", "SCALES", "open_judge", "why_missing"]

SCALES: dict[str, Scale] = {of.SCALE.name: of.SCALE for of in (AqmJudge, Flip, Psnr, Temporal, ColorVideoVdp)}
JUDGES = tuple(SCALES)


def open_judge(name: str, viewing: Viewing, *, pursuit: Pursuit = Pursuit.BOTH) -> Judge:
    """Make a judge for one sequence.

    Parameters
    ----------
    name
        One of :data:`JUDGES`.
    viewing
    pursuit
        What the eye does while the image moves: AQM alone asks.

    Raises
    ------
    SettingsError
        There is no such judge, or what it needs is not installed; the message says how to get it.
    """
    match name:
        case "aqm":
            return AqmJudge(viewing, pursuit=pursuit)
        case "flip":
            return Flip(viewing)
        case "psnr":
            return Psnr()
        case "temporal":
            return Temporal()
        case "cvvdp":
            return ColorVideoVdp(viewing)
        case _:
            raise SettingsError(f"there is no judge {name!r}; known are: {', '.join(JUDGES)}")


def why_missing(name: str) -> str:
    """Why a judge can't be had here, and how to get it; empty where it can."""
    if name == "flip" and find_spec("flip_evaluator") is None:
        return "FLIP is left out: pip install 'enfilade[judges]' brings it"
    if name == "cvvdp" and find_spec("pycvvdp") is None:
        return "ColorVideoVDP is left out: pip install cvvdp brings it, and PyTorch"
    return ""
