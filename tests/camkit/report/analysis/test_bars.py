"""Bars: contrast by the series of a square wave, detection by what two Gaussians give."""

import numpy as np
import pytest
from scipy.stats import norm

from camkit.errors import ContractError
from camkit.noise import NoiseModel
from camkit.report.analysis.bars import (
    CONFIDENCE,
    WHITE,
    contrast_of,
    interval,
    least_difference,
    see_bars,
)
from camkit.runtime.twin.exposure import Setting, noise_of
from tests.bundle_factory import tiny_sensor
from tests.camkit.report.analysis.gaussians import gaussian_image, gaussian_line


def test_bars_behind_no_blur_keep_their_contrast() -> None:
    assert contrast_of(np.array([0.0, 1.0, 0.0]), 1) == 1
    assert contrast_of(np.array([0.0, 1.0, 0.0]), 7) == 1


@pytest.mark.parametrize(("sigma_px", "width_px"), [(6.0, 15), (9.0, 15), (4.0, 21)])
def test_contrast_is_the_series_of_the_square_wave(sigma_px: float, width_px: int) -> None:
    """A square wave is 4 / pi times odd harmonics of alternating sign at its crests."""
    odd = np.arange(1, 400, 2)
    mtf = np.exp(-2 * (np.pi * sigma_px * odd / (2 * width_px)) ** 2)
    series = 4 / np.pi * ((-1) ** (odd // 2) * mtf / odd).sum()
    # bars of whole pixels: their rims lie between pixels, as those of the series do
    assert contrast_of(gaussian_line(sigma_px), width_px) == pytest.approx(series, abs=2e-3)


def test_a_blur_as_wide_as_three_bars_turns_them_over() -> None:
    box = np.zeros(31)
    box[15 - 7 : 15 + 8] = 1 / 15
    assert contrast_of(box, 5) == pytest.approx(-1 / 3)


def test_a_bar_has_a_width() -> None:
    with pytest.raises(ContractError, match="1 px wide"):
        contrast_of(np.ones(3), 0)


def _expected(signals: tuple[float, float], noise: NoiseModel, step: float) -> float:
    """Give the share of pairs that are told apart where noise is Gaussian."""
    shot, read = noise.shot[1], noise.read_variance[1] + step**2 / 12
    bright, dark = signals
    least = 1.6449 * np.sqrt(2 * (shot * (bright + dark) / 2 + read))
    return float(norm.sf((least - (bright - dark)) / np.sqrt(shot * (bright + dark) + 2 * read)))


@pytest.mark.parametrize("sigma_px", [5.5, 6.5, 7.3, 8.0])
def test_detection_is_what_two_gaussians_give(sigma_px: float) -> None:
    """Counted with photons and a converter, against the normal distribution."""
    sensor, iso = tiny_sensor(), 100.0
    image = gaussian_image(sigma_px)
    bars = see_bars(image, "radial", 8, sensor, iso)
    mean = WHITE / 2
    noise = noise_of(sensor, Setting(iso=iso))
    step = 1 / (sensor.white_level - sensor.black_level)
    told = _expected((mean * (1 + bars.contrast), mean * (1 - bars.contrast)), noise, step)
    assert bars.detection == pytest.approx(told, abs=0.015)
    low, high = bars.detection_ci
    assert low <= bars.detection <= high
    assert high - low < 0.02


def test_without_contrast_chance_is_left() -> None:
    bars = see_bars(gaussian_image(60.0), "radial", 4, tiny_sensor(), 100.0)
    assert bars.contrast == pytest.approx(0, abs=1e-4)
    assert bars.detection == pytest.approx(1 - CONFIDENCE, abs=0.01)


def test_the_cdp_of_the_standard_asks_for_half_of_the_contrast() -> None:
    sensor = tiny_sensor()
    weak, strong = (see_bars(gaussian_image(s), "radial", 12, sensor, 100.0) for s in (7.0, 2.0))
    assert weak.contrast < 0.5 < strong.contrast
    # both are told apart; only one keeps its contrast
    assert weak.detection > 0.99
    assert (weak.cdp, strong.cdp) == (0.0, 1.0)


def test_dark_corners_are_told_apart_less() -> None:
    sensor = tiny_sensor()
    bright, dark = (
        see_bars(gaussian_image(8.0, illumination=light), "radial", 8, sensor, 100.0)
        for light in (1.0, 0.1)
    )
    assert bright.contrast == dark.contrast
    assert dark.detection < bright.detection


def test_the_interval_of_a_share_holds_it_in_19_of_20_draws() -> None:
    rng = np.random.default_rng(1)
    held = [
        low <= 0.1 <= high
        for low, high in (interval(int(n), 200) for n in rng.binomial(200, 0.1, 2000))
    ]
    assert np.mean(held) == pytest.approx(0.95, abs=0.02)
    assert interval(0, 50)[0] == 0.0
    assert interval(50, 50)[1] == 1.0


def test_equal_signals_are_told_apart_by_chance() -> None:
    noise, rng = NoiseModel(shot=(1e-4,) * 3, read_variance=(1e-8,) * 3), np.random.default_rng(2)
    one, other = 0.4 + np.sqrt(1e-4 * 0.4 + 1e-8) * rng.standard_normal((2, 100_000))
    told = (one - other > least_difference(0.4, noise, 0.0)).mean()
    assert told == pytest.approx(1 - CONFIDENCE, abs=3e-3)
