"""A response that nobody states is found from codes alone."""

import numpy as np
import pytest
from numpy.typing import NDArray

from camkit.errors import DecodeError
from camkit.runtime.merging.response import srgb_response
from camkit.runtime.merging.response_estimate import disagreement, estimate_response

TIMES_S = np.array([4.0, 2.0, 1.0, 0.5, 0.25])


def film_curve() -> NDArray[np.float64]:
    """Give the light of each code of a contrasty curve with toe and shoulder; 128 as in sRGB."""
    code = np.arange(256) / 255
    light = code**2.8 * (1 + 0.8 * code**6)
    return light * np.exp(srgb_response(256).log_light[0, 128]) / light[128]


def _codes(pixels: int, *, moved: float = 0.0) -> NDArray[np.uint8]:
    rng = np.random.default_rng(1)
    light = 2.0 ** rng.uniform(-9, 1, (3, pixels))
    frames = []
    for time_s in TIMES_S:
        seen = np.where(rng.random((3, pixels)) < moved, rng.permuted(light, axis=1), light)
        codes = np.interp(seen * time_s, film_curve(), np.arange(256))
        frames.append(np.rint(codes + rng.normal(0, 0.4, codes.shape)).clip(0, 255))
    return np.stack(frames).astype(np.uint8)


@pytest.mark.parametrize(("moved", "within"), [(0.0, 0.03), (0.05, 0.05)])
def test_a_film_like_curve_is_found_also_where_things_moved(moved: float, within: float) -> None:
    codes = _codes(6000, moved=moved)
    found = estimate_response(codes, TIMES_S)
    error = (found.log_light - np.log(np.maximum(film_curve(), 1e-9)))[:, 24:250]
    assert np.abs(error).max() < within
    plain = disagreement(codes, TIMES_S, srgb_response(256))
    assert disagreement(codes, TIMES_S, found) < 0.5 * plain
    assert (np.diff(found.log_light, axis=1) >= 0).all()


def test_codes_that_never_occur_take_the_shape_of_srgb() -> None:
    plain = srgb_response(256)
    rng = np.random.default_rng(0)
    light = 2.0 ** rng.uniform(-2.2, -1.2, (3, 3000))
    srgb = np.exp(plain.log_light[0].astype(np.float64))
    codes = [np.rint(np.interp(light * t, srgb, np.arange(256))) for t in (1.0, 0.7)]
    found = estimate_response(np.stack(codes).astype(np.uint8), np.array([1.0, 0.7]))
    assert np.abs(found.log_light - plain.log_light)[:, 5:].max() < 0.05


def test_too_few_open_pixels_are_refused() -> None:
    codes = np.full((2, 3, 2000), 255, dtype=np.uint8)
    with pytest.raises(DecodeError, match="there are 0: use response"):
        estimate_response(codes, np.array([1.0, 0.5]))
    assert disagreement(codes, np.array([1.0, 0.5]), srgb_response(256)) == np.inf
