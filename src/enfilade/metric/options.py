"""What the metric does otherwise than the paper, each departure by its own name."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, Literal, Self

from enfilade.errors import InputError

__all__ = ["MetricOptions"]


@dataclass(frozen=True)
class MetricOptions:
    """Departures from the published metric; all off is the paper, all on is the modern mode.

    An ablation switches one of them off: ``MetricOptions.modern().without("transient")``.

    Parameters
    ----------
    csf : {"paper", "castle"}
        Contrast sensitivity: Eq. 4 (`metric.csf`), or castleCSF (`metric.castle`).
    luminance_adaptive : bool
        Contrast and sensitivity at the luminance that surrounds each pixel, instead of contrast of
        the retina's response over the mean of the image (`metric.adaptation`).
    hold_blur : bool
        A frame stands still while it is held, and an eye that follows the motion smears it
        (`metric.eye`); the paper's screens flashed.
    csf_within_bands : bool
        The CSF varies within a band as it does for still images, instead of being that of the
        band's centre throughout.
    ripple_free : bool
        Channels are pooled with exponent 2, so that contrast between the centres of channels
        counts as much as at them, instead of 3.5.
    transducer : bool
        Masking by a transducer, in which a faint mask helps and a strong one hides
        (`metric.transducer`), instead of threshold elevation, in which it only hides.
    spatial_pooling : bool
        What the eye gathers around the point that it looks at, instead of each pixel by itself.
    transient : bool
        Errors that change from frame to frame count besides those that stay.
    """

    csf: Literal["paper", "castle"] = "paper"
    luminance_adaptive: bool = False
    hold_blur: bool = False
    csf_within_bands: bool = False
    ripple_free: bool = False
    transducer: bool = False
    spatial_pooling: bool = False
    transient: bool = False

    def __post_init__(self) -> None:
        if self.csf not in ("paper", "castle"):
            msg = f"metric: csf is {self.csf!r}; give 'paper' or 'castle'"
            raise InputError(msg)

    @classmethod
    def paper(cls) -> Self:
        """The published metric."""
        return cls()

    @classmethod
    def modern(cls) -> Self:
        """All departures together."""
        return cls(
            csf="castle",
            luminance_adaptive=True,
            hold_blur=True,
            csf_within_bands=True,
            ripple_free=True,
            transducer=True,
            spatial_pooling=True,
            transient=True,
        )

    @classmethod
    def departures(cls) -> tuple[str, ...]:
        """Names of all departures, in the order of the stages."""
        return tuple(field.name for field in fields(cls))

    def without(self, departure: str) -> Self:
        """The same options but for one departure, which goes back to the paper's.

        Parameters
        ----------
        departure : str
            One of `departures`.

        Raises
        ------
        InputError
            There is no departure of that name; the message lists those that there are.
        """
        if departure in self.departures():
            published: Any = getattr(self.paper(), departure)
            return replace(self, **{departure: published})
        msg = f"metric: unknown departure {departure!r}; known are: {', '.join(self.departures())}"
        raise InputError(msg)
