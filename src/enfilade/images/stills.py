"""Still pictures for web pages, in memory: WebP."""

from __future__ import annotations

from io import BytesIO

import numpy as np
from PIL import Image

from enfilade.records import U8

__all__ = ["encode_webp", "resized"]

EFFORT = 4  # of WebP's encoder, 0 to 6: beyond it, time grows faster than files shrink


def encode_webp(picture: U8, *, quality: int | None) -> bytes:
    """Encode a picture as WebP.

    Parameters
    ----------
    picture : (H, W, 3) or (H, W, 4) uint8
        Encoded for an sRGB screen; the fourth channel is opacity.
    quality
        0 to 100; None: without loss.
    """
    out = BytesIO()
    image = Image.fromarray(picture)
    if quality is None:
        image.save(out, "WEBP", lossless=True, quality=50, method=EFFORT)
    else:
        image.save(out, "WEBP", quality=quality, method=EFFORT)
    return out.getvalue()


def resized(picture: U8, size: tuple[int, int], *, is_mixed: bool) -> U8:
    """Scale a picture.

    Parameters
    ----------
    picture : (H, W, 3) or (H, W, 4) uint8
    size
        Width and height, pixels. Of the same size the picture is given back as it is.
    is_mixed
        Whether neighbours may be mixed; otherwise each pixel is one of the picture's.
    """
    if (picture.shape[1], picture.shape[0]) == size:
        return picture
    filtering = Image.Resampling.BOX if is_mixed else Image.Resampling.NEAREST
    scaled: U8 = np.asarray(Image.fromarray(picture).resize(size, filtering), np.uint8)
    return scaled
