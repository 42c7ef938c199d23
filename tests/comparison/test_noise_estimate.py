"""The noise of one reference: found where it is, and texture is not taken for it."""

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import gaussian_filter

from enfilade.comparison.noise_estimate import noise_sigma
from enfilade.kernels.tone import srgb_decode, srgb_encode
from support.sequences import compared

SHIFT_PX = 1.4  # a frame, to the left: no whole pixels


def shading(shift=0.0):
    y, x = np.mgrid[:90, :160].astype(np.float32)
    return (0.2 + 0.5 * (x + shift) / 200.0 + 0.2 * y / 90.0).astype(np.float32)


def stripes(shift=0.0):
    y, x = np.mgrid[:90, :160].astype(np.float32)
    return (0.4 + 0.2 * np.sin(0.9 * (x + shift) + 0.4 * y)).astype(np.float32)


def grain(shift=0.0):
    """A random texture of one texel a pixel, moved by interpolation as a renderer does."""
    texels = np.random.default_rng(5).uniform(0.2, 0.8, (90, 180))
    places = np.arange(160) + shift
    left = places.astype(int)
    part = places - left
    return ((1.0 - part) * texels[:, left] + part * texels[:, left + 1]).astype(np.float32)


def blobs(shift=0.0):
    """A texture with the spectrum of many materials: energy falls with frequency."""
    texels = gaussian_filter(np.random.default_rng(6).normal(size=(900, 2000)), 15.0)
    first = round(10 * shift)
    fine = texels[:, first : first + 1600] / texels.std()
    return (0.5 + 0.1 * fine.reshape(90, 10, 160, 10).mean(axis=(1, 3))).astype(np.float32)


def flow(image):
    found = np.zeros((*image.shape, 2), np.float32)
    found[..., 0] = SHIFT_PX
    return found


@pytest.mark.parametrize("texture", [shading, stripes, grain, blobs])
def test_clean_images_have_no_noise(texture):
    last, image = texture(0.0), texture(SHIFT_PX)
    assert noise_sigma(image, last, flow(image)) == 0.0
    assert noise_sigma(image, image, None) == 0.0


@pytest.mark.parametrize(
    ("texture", "sigma"), [(shading, 0.005), (shading, 0.03), (shading, 0.1), (blobs, 0.03), (blobs, 0.1)]
)
def test_noise_is_found_with_its_deviation(texture, sigma):
    random = np.random.default_rng(1)
    last, image = (
        texture(shift) + random.normal(0.0, sigma, (90, 160)).astype(np.float32) for shift in (0.0, SHIFT_PX)
    )
    found = noise_sigma(image, last, flow(image))
    # 220 blocks of 64 values: the median scatters by 2 %. Texture hides a part, and must not add to it.
    assert 0.7 * sigma < found < 1.05 * sigma


def test_noise_of_half_the_image_is_found():
    random = np.random.default_rng(2)
    frames = [shading(), shading()]
    for frame in frames:
        frame[:, :80] = 1.0  # clipped to white
        frame[:, 80:] += random.normal(0.0, 0.03, (90, 80)).astype(np.float32)
    assert noise_sigma(frames[1], frames[0], None) == pytest.approx(0.03, rel=0.15)


def test_too_few_blocks_are_no_evidence():
    random = np.random.default_rng(3)
    last, image = random.uniform(0.2, 0.8, (2, 20, 24)).astype(np.float32)
    assert noise_sigma(image, last, None) == 0.0
    assert noise_sigma(image[:6], last[:6], None) == 0.0


def frames_with(sigma, seed):
    random = np.random.default_rng(seed)
    clean = srgb_decode(shading()[:48, :64])[..., None].repeat(3, axis=2)
    noise = random.normal(0.0, sigma, (5, 48, 64, 1))
    return [np.maximum(clean + of_frame, 0.0).astype(np.float32) for of_frame in noise]


def test_a_noisy_reference_is_reported_with_a_remedy(sequence):
    clean, reference = sequence("clean", frames_with(0.0, 1)), sequence("noisy", frames_with(0.03, 2))
    found = compared(clean, reference, flow="estimate")
    estimate = found.to_dict()["noise_estimate"]
    # All of the difference is noise of the reference. The encoded noise is stronger where it is darker; the
    # estimate is its median.
    assert estimate["score_jnd"] == pytest.approx(found.score, rel=0.25)
    assert estimate["is_notable"]
    assert f"{estimate['score_jnd']:.1f} JND" in found.noise_note
    assert "--second-reference" in found.noise_note
    assert compared(reference, reference, flow="estimate").noise_note == ""  # identical


def test_noise_that_hardly_matters_is_not_mentioned(sequence):
    reference, far = sequence("noisy", frames_with(0.005, 2)), sequence("far", frames_with(0.1, 1))
    found = compared(far, reference, flow="estimate")
    assert 0.0 < found.noise_estimate.score < found.score / 3.0
    assert found.noise_note == ""


def test_noise_that_the_test_shares_is_no_part_of_the_score(sequence, tmp_path):
    """The test is the reference as JPEGs."""
    frames = frames_with(0.03, 2)
    (tmp_path / "jpeg").mkdir()
    for number, frame in enumerate(frames, 1):
        encoded = np.round(255.0 * np.clip(srgb_encode(frame), 0.0, 1.0)).astype(np.uint8)
        Image.fromarray(encoded).save(tmp_path / "jpeg" / f"{number:04}.jpg", quality=95)
    found = compared(tmp_path / "jpeg", sequence("noisy", frames), flow="estimate")
    estimate = found.to_dict()["noise_estimate"]
    assert estimate["score_jnd"] > 2.0 * found.score > 0.0
    assert not estimate["is_notable"]
    assert "the test seems to have the same noise" in found.noise_note
    assert "--second-reference" not in found.noise_note


def test_nothing_is_estimated_without_motion(sequence, monkeypatch):
    monkeypatch.delattr("enfilade.comparison.noise_estimate.noise_sigma")
    frames = frames_with(0.03, 2)
    for reference in (sequence("one", frames[:1]), sequence("several", frames)):
        found = compared(reference, reference, flow="none")
        assert found.noise_estimate is None
