"""Light in the numbers of other people's networks, and back."""

import numpy as np
import pytest
from skimage.color import rgb2xyz, xyz2rgb

from camkit.noise import NoiseModel
from camkit.runtime.rows import ArrayRows
from camkit.runtime.signal.coding import (
    CodedRows,
    PlaneCoding,
    linear_of_srgb,
    srgb_curve,
    srgb_slope,
)

MATRIX = np.array([[1.6, -0.5, -0.1], [-0.2, 1.5, -0.3], [0.0, -0.4, 1.4]])
NOISE = NoiseModel(shot=(1e-5, 2e-5, 3e-5), read_variance=(1e-7, 2e-7, 3e-7))


def _coding(space: str, **changes: object) -> PlaneCoding:
    fields: dict[str, object] = {
        "matrix": MATRIX,
        "exposure": 1.0,
        "gain": (1.0,),
        "offset": (0.0,),
    }
    return PlaneCoding(space=space, **(fields | changes))  # type: ignore[arg-type]


def test_the_curve_is_that_of_another_program() -> None:
    light = np.linspace(0, 1, 301)
    grey = np.stack([light] * 3, axis=-1)[None]
    linear_xyz = grey @ (rgb2xyz(np.eye(3)[None])[0])
    np.testing.assert_allclose(srgb_curve(light), xyz2rgb(linear_xyz)[0, :, 1], atol=2e-4)


def test_the_curve_goes_on_beyond_black_and_white_and_back() -> None:
    light = np.linspace(-0.2, 30, 4001)
    coded = srgb_curve(light)
    assert (np.diff(coded) > 0).all()
    np.testing.assert_allclose(linear_of_srgb(coded), light, atol=1e-6)
    steps = (srgb_curve(light + 1e-6) - srgb_curve(light - 1e-6)) / 2e-6
    np.testing.assert_allclose(srgb_slope(light)[100:], steps[100:], rtol=1e-4)


@pytest.mark.parametrize("space", ["camera", "rec709", "srgb"])
def test_what_is_coded_comes_back(space: str) -> None:
    light = np.random.default_rng(1).uniform(-0.05, 3, (3, 7, 11)).astype(np.float32)
    coding = _coding(space, exposure=4.0, gain=(2.0, 3.0, 4.0), offset=(-1.0, 0.5, 0.0))
    out = np.empty_like(light)
    coding.encode(light, out)
    coding.decode(out)
    np.testing.assert_allclose(out, light, atol=2e-6)


def test_the_map_is_the_spread_of_many_noisy_samples() -> None:
    rng = np.random.default_rng(5)
    light = np.full((3, 400, 400), 0.2, np.float32)
    light[1] = 0.4
    deviation = np.sqrt(
        light * np.array(NOISE.shot)[:, None, None] + np.array(NOISE.read_variance)[:, None, None]
    )
    noisy = (light + deviation * rng.standard_normal(light.shape)).astype(np.float32)
    coding = _coding("srgb", gain=(255.0,))
    out = np.empty_like(noisy)
    coding.encode(noisy, out)
    expected = np.sqrt((out.std(axis=(1, 2)) ** 2).mean())
    assert coding.deviation(light, NOISE)[0, 0, 0] == pytest.approx(expected, rel=0.02)


def test_rows_have_the_bits_of_the_whole_wherever_they_are_cut() -> None:
    light = np.random.default_rng(2).uniform(-0.1, 2, (3, 57, 33)).astype(np.float32)
    coding = _coding("srgb", gain=(255.0,))
    whole = CodedRows([ArrayRows(light)], coding, noise=NOISE).read(0, 57)
    assert whole.shape == (4, 57, 33)
    rows = CodedRows([ArrayRows(light)], coding, noise=NOISE, threads=2)
    parts = [rows.read(a, b) for a, b in ((0, 1), (1, 20), (20, 57))]
    np.testing.assert_array_equal(np.concatenate(parts, axis=1), whole)
