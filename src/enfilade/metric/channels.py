"""Images of one size through the Cortex transform: mirrored beyond their borders, channels cropped."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.fft

from enfilade.metric.cortex import OVERSAMPLING, Band, Complex64, CortexTransform, Tilt, bands
from enfilade.metric.pyramid import halved_shape
from enfilade.records import F32, Mask
from enfilade.viewing import Viewing


@dataclass(frozen=True, eq=False)
class Channel:
    """Responses of one channel, (h, w) float32 at the band's size.

    Attributes
    ----------
    reference, difference
        Of the reference, and of test - reference.
    counted
        The difference without its uniform part.
    uniform
        `uniform_part` of the difference; None but in the base.
    """

    reference: F32
    difference: F32
    counted: F32
    uniform: F32 | None


class ChannelBank:
    """Makes spectra of images and channels of spectra.

    Images of any size from 1x1 up are continued by their mirror image, by one period of the lowest
    ring at least, to a size that is quick to transform; so neither border rings over the image.

    Parameters
    ----------
    viewing : Viewing
        Size of the images, and pixels per degree.
    tilt, oversampling
        As in `CortexTransform`.
    """

    def __init__(
        self, viewing: Viewing, *, tilt: Tilt | None = None, oversampling: float = OVERSAMPLING
    ) -> None:
        density = viewing.pixels_per_degree
        self.image_shape = viewing.height_px, viewing.width_px
        base = bands(density, oversampling)[-1]
        self._margin_px = 2 ** (base.level - 1)  # one period of the lowest ring's centre
        self._rows, self._columns = (
            _mirrored_indices(length, self._margin_px, 2 * base.reduction) for length in self.image_shape
        )
        self.cortex = CortexTransform(
            len(self._rows), len(self._columns), density, tilt=tilt, oversampling=oversampling
        )
        self.bands = self.cortex.bands

    def pad(self, image: F32) -> F32:
        """Continue an image to the transform's size."""
        return image.take(self._rows, axis=0).take(self._columns, axis=1)

    def spectra(self, *images: F32) -> Complex64:
        """Spectra of images of the bank's size."""
        padded = np.empty((len(images), len(self._rows), len(self._columns)), dtype=np.float32)
        for plane, image in zip(padded, images, strict=True):
            plane[...] = self.pad(image)
        return self.cortex.spectra(padded)

    def shape(self, band: Band) -> tuple[int, int]:
        """Height and width of a band's channels, cropped to the image."""
        return halved_shape(self.image_shape, band.reduction)

    def crop(self, channels: F32, band: Band) -> F32:
        """Cut the border off maps at a band's size, (..., padded) -> (..., h, w); a view."""
        height, width = self.shape(band)
        start = self._margin_px // band.reduction
        return channels[..., start : start + height, start : start + width]

    def channels(self, spectra: Complex64, band: Band, valid: Mask) -> Iterator[Channel]:
        """Channels of a band, in the order of its orientations.

        Parameters
        ----------
        spectra : (2, ...) complex64
            Of the reference and of test - reference.
        band : Band
        valid : (H, W) bool
            Pixels to compare.
        """
        ring = self.cortex.ring(spectra, band)
        for orientation in band.orientations:
            reference, difference = self.crop(self.cortex.fan(ring, band, orientation), band)
            counted, uniform = difference, None
            if band.is_base:
                uniform = uniform_part(difference, valid[:: band.reduction, :: band.reduction])
                counted = difference - uniform
            yield Channel(reference, difference, counted, uniform)

    def ring(self, spectrum: Complex64, band: Band) -> F32:
        """All orientations of a band together, (...) complex64 -> (h, w) float32."""
        ring = self.cortex.ring(spectrum, band)
        return self.crop(self.cortex.fan(ring, band, None), band)


def uniform_part(difference: F32, valid: Mask) -> F32:
    """The part of the base band's difference (h, w) that is the same everywhere.

    At each sample as much of the median over the valid area as its own difference contains: none where
    that has the other sign. `valid` may have fewer rows and columns than the difference.

    A uniform difference has no frequency, so that it does not move over the retina however fast the
    image does, and it is seen as if it stood still. (As part of the base band it would be taken for a
    pattern of 0.2 cycles per degree, to which Eq. 4 is thirty times more sensitive at 20 deg/s than at
    rest.) The median, unlike the mean, leaves a local defect local; and where most of an image differs,
    the part that does not differ stays 0.
    """
    rows, columns = valid.shape
    compared = difference[:rows, :columns][valid]
    median = np.float32(np.median(compared) if compared.size else 0.0)
    return np.clip(difference, np.minimum(median, 0.0), np.maximum(median, 0.0))


def _mirrored_indices(length: int, margin: int, multiple: int) -> npt.NDArray[np.intp]:
    """Source indices of a length continued by mirroring, `margin` or more on both sides."""
    units = -(-(length + 2 * margin) // multiple)
    padded = multiple * scipy.fft.next_fast_len(units, real=True)
    period = 2 * length
    phase = (np.arange(padded) - margin) % period
    return np.minimum(phase, period - 1 - phase)
