"""Known curves are taken where they explain a bracket, and only there."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.colorimetry import encode_srgb
from camkit.runtime.merging.known_curves import known_curve, misfit_codes, power_response
from camkit.runtime.merging.merge import choose_response, merge
from camkit.runtime.merging.response import srgb_response
from camkit.runtime.merging.response_estimate import estimate_response
from camkit.runtime.merging.survey import survey
from tests.runtime.merging.test_response_estimate import film_curve

TIMES = {"three": (4.0, 1.0, 0.25), "five": (1.0, 0.5, 0.25, 0.125, 0.0625), "two": (1.0, 0.0625)}


def _one_hue(y: FloatArray, x: FloatArray) -> FloatArray:
    """Return colours of one ratio everywhere, whose codes a JPEG always rounds alike."""
    light = 2.0 ** (-9 + 10 * x * (0.5 + 0.5 * y))
    return np.stack([light, 0.8 * light, 0.6 * light])


def _ramps(y: FloatArray, x: FloatArray) -> FloatArray:
    return np.stack([2.0 ** (-10 + 11 * x), 2.0 ** (-9 + 9 * y), 2.0 ** (-8 + 4.5 * (x + y))])


def _waves(y: FloatArray, x: FloatArray) -> FloatArray:
    planes = [2.0 ** (-5 + 4 * np.sin(6 * x + n) + 1.5 * np.cos(5 * y + n)) for n in range(3)]
    return np.stack(planes)


SCENES = {"one hue": _one_hue, "ramps": _ramps, "waves": _waves}


def _light(scene: str) -> FloatArray:
    y, x = np.mgrid[:240, :320] / np.array([240, 320]).reshape(2, 1, 1)
    return np.asarray(SCENES[scene](y, x), dtype=np.float32)


def _bracket(
    folder: Path,
    light: FloatArray,
    times_s: Sequence[float],
    *,
    quality: int,
    curve: NDArray[np.float64] | None = None,
) -> list[Path]:
    paths = []
    for number, time_s in enumerate(times_s):
        seen = light * np.float32(time_s)
        codes = encode_srgb(seen) * 255 if curve is None else np.interp(seen, curve, range(256))
        paths.append(folder / f"{number}.jpg")
        pixels = np.rint(codes).clip(0, 255).astype(np.uint8)[::-1].transpose(1, 2, 0)
        assert cv2.imwrite(str(paths[-1]), pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return paths


def _error(folder: Path, light: FloatArray, times_s: Sequence[float], quality: int) -> float:
    """Return the median relative error of the shadows of merged light."""
    bracket = survey(_bracket(folder, light, times_s, quality=quality), times_s)
    merged = merge(bracket, choose_response(bracket, None)[0])
    shadows = (light * times_s[0] > 0.003) & (light * times_s[0] < 0.03)
    found = merged.light[shadows] / (light[shadows] * times_s[0])
    return float(abs(np.median(found) - 1))


@pytest.mark.parametrize("quality", [95, 75])
@pytest.mark.parametrize("times", TIMES)
@pytest.mark.parametrize("scene", SCENES)
def test_shadows_of_a_smooth_srgb_bracket_are_right(
    tmp_path: Path, scene: str, times: str, quality: int
) -> None:
    assert _error(tmp_path, _light(scene), TIMES[times], quality) < 0.02


@pytest.mark.parametrize("gamma", [1.8, 2.2, 2.6])
def test_a_power_of_light_is_found(tmp_path: Path, gamma: float) -> None:
    curve = np.exp(power_response(gamma).log_light[0].astype(np.float64))
    paths = _bracket(tmp_path, _light("waves"), TIMES["five"], quality=95, curve=curve)
    response, note = choose_response(survey(paths, TIMES["five"]), None)
    assert response is not None
    assert response.name == "estimate"
    assert f"a gamma of {gamma:.1f}" in note
    error = response.log_light[:, 8:] - power_response(gamma).log_light[:, 8:]
    assert np.abs(error).max() < 0.03


def test_another_curve_is_no_known_one(tmp_path: Path) -> None:
    paths = _bracket(tmp_path, _light("waves"), TIMES["five"], quality=95, curve=film_curve())
    found = survey(paths, TIMES["five"])
    assert found.codes is not None
    assert known_curve(found.codes, found.times_s) is None
    free = estimate_response(found.codes, found.times_s)
    assert misfit_codes(found.codes, found.times_s, free) < 0.5
    response, note = choose_response(found, None)
    assert (response is not None and response.name, note) == ("estimate", "")


def test_where_nothing_is_unclipped_twice_no_curve_is_known() -> None:
    codes = np.full((2, 3, 2000), 255, dtype=np.uint8)
    assert known_curve(codes, np.array([1.0, 0.5])) is None
    assert misfit_codes(codes, np.array([1.0, 0.5]), srgb_response(256)) == np.inf
