"""What the metric does otherwise than the paper, each departure by its own name."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, Self

from enfilade.errors import InputError

__all__ = ["Fitted", "MetricOptions"]


@dataclass(frozen=True)
class Fitted:
    """Numbers of the modern mode that were set by looking at what people see; all others are cited.

    `enfilade validate` sets each anew with a part of the data left out, and says what that part then
    shows.

    Parameters
    ----------
    semi_saturation : float
        z of the transducer, no unit, with broad masking: fitted to the ten masks of Foley 1994, together
        with `neighbour_share`.
    narrow_semi_saturation : float
        z without broad masking, fitted alike.
    neighbour_share : float
        How much a neighbouring band masks, against a neighbouring orientation; no unit.
    aperture_sigma_deg : float
        Standard deviation of the aperture of spatial pooling, degrees: chosen. Models of detection have
        0.25 to 0.6 deg (Watson and Ahumada 2005, J. Vis. 5(9): 0.6); ModelFest does not tell these
        apart, and a small one leaves a sharper map.

    Raises
    ------
    InputError
        A number is not above 0; `neighbour_share` may be 0.
    """

    semi_saturation: float = 1.3
    narrow_semi_saturation: float = 0.7
    neighbour_share: float = 0.5
    aperture_sigma_deg: float = 0.3

    def __post_init__(self) -> None:
        for field in fields(self):
            number = getattr(self, field.name)
            if not (math.isfinite(number) and (number > 0 or (number == 0 and "share" in field.name))):
                msg = f"metric: {field.name} is {number!r}; give a finite number above 0"
                raise InputError(msg)


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
        band's centre throughout; and what moves is judged by the direction that it has within a
        channel, where energies are gathered (`metric.direction`).
    ripple_free : bool
        Channels are pooled with exponent 2, so that contrast between the centres of channels
        counts as much as at them, instead of 3.5.
    transducer : bool
        Masking by a transducer, in which a faint mask helps and a strong one hides
        (`metric.transducer`), instead of threshold elevation, in which it only hides.
    broad_masking : bool
        Neighbouring bands mask too, as neighbouring orientations do. Without the transducer or
        spatial pooling it does nothing.
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
    broad_masking: bool = False
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
            broad_masking=True,
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
