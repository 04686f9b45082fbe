"""Pictures in linear light: finite, within what the capture holds, and as bright as it is."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.ndimage
from hypothesis import example, given, settings
from hypothesis import strategies as st

from camkit.noise import NoiseModel
from camkit.runtime.capture import Capture
from camkit.runtime.pipeline import Pipeline, load

SIDE = 192
BLACK, WHITE = 256.0, 4095.0
MARGIN_PX = 32
"""At the borders of a crop the bank sees mirrored light."""


@pytest.fixture(scope="module")
def pipeline() -> Pipeline:
    return load(
        "duet", size="S", vignetting=False, color="camera", white_balance=(1.0, 1.0, 1.0), threads=1
    )


def _capture(light: np.ndarray, shot: float, read_e: float, seed: int) -> Capture:
    """Photograph light by a sensor with noise, in the middle of the field."""
    rng = np.random.default_rng(seed)
    electrons = rng.poisson(light / shot) + read_e * rng.standard_normal(light.shape)
    samples = np.clip(np.round(electrons * shot * (WHITE - BLACK) + BLACK), 0, WHITE)
    return Capture(
        samples=samples.astype(np.uint16),
        cfa="RGGB",
        black_level=np.full((2, 2), BLACK, np.float32),
        white_level=WHITE,
        origin_px=(2900, 1900),
        sensor_size_px=(6000, 4000),
    )


def _blurred(seed: int) -> np.ndarray:
    """Give a random pattern as no sharper than lenses are, 0..1."""
    pattern = scipy.ndimage.gaussian_filter(
        np.random.default_rng(seed).random((SIDE, SIDE)), 2, mode="wrap"
    )
    return np.asarray((pattern - pattern.min()) / np.ptp(pattern))


def _signal(capture: Capture) -> np.ndarray:
    return np.asarray((capture.samples.astype(np.float64) - BLACK) / (WHITE - BLACK))


@example(level=1.0, is_flat=False, shot=1e-4, read_e=1.0, told="nothing", seed=122)
@example(level=0.42, is_flat=False, shot=1e-3, read_e=7.0, told="ISO 100", seed=2)
@given(
    level=st.floats(0.0, 1.0),
    is_flat=st.booleans(),
    shot=st.sampled_from([1e-5, 1e-4, 1e-3]),
    read_e=st.floats(0.5, 20.0),
    told=st.sampled_from(["nothing", "the truth", "ISO 100", "ISO 1600"]),
    seed=st.integers(0, 2**20),
)
@settings(max_examples=20, deadline=None)
def test_a_picture_stays_within_what_the_capture_holds(
    pipeline: Pipeline,
    level: float,
    is_flat: bool,
    shot: float,
    read_e: float,
    told: str,
    seed: int,
) -> None:
    light = np.full((SIDE, SIDE), level) if is_flat else level * _blurred(seed)
    capture = _capture(light, shot, read_e, seed)
    truth = NoiseModel(shot=(shot,) * 3, read_variance=((read_e * shot) ** 2,) * 3)
    known = {
        "nothing": {},
        "the truth": {"noise": truth},
        "ISO 100": {"iso": 100.0},
        "ISO 1600": {"iso": 1600.0},
    }[told]
    picture = pipeline.start(replace(capture, **known)).fill()  # type: ignore[arg-type]
    signal = _signal(capture)
    assert np.isfinite(picture).all()
    brightest = signal.max() + 0.02
    least, most = -brightest, 4 * brightest
    if picture.min() < least or picture.max() > most:
        # a pattern sharper than the lens passes, or noise 20 times what the file tells of it:
        # what the bank gave the network went as far
        bank = Pipeline(pipeline.bundle, replace(pipeline.options, method="wiener", size=None))
        sharp = bank.start(replace(capture, **known)).fill()  # type: ignore[arg-type]
        least, most = min(least, sharp.min()), max(most, sharp.max())
    assert least <= picture.min()
    assert picture.max() <= most, "sharper than its capture, and no more than that"


@pytest.mark.parametrize("level", [0.0, 0.001, 0.01])
@pytest.mark.parametrize("read_e", [0.5, 1.0, 3.0, 10.0, 20.0])
@pytest.mark.parametrize("shot", [2e-5, 1e-3])
def test_the_dark_is_as_dark_as_it_was_whatever_the_read_noise(
    pipeline: Pipeline, shot: float, read_e: float, level: float
) -> None:
    noise = NoiseModel(shot=(shot,) * 3, read_variance=((read_e * shot) ** 2,) * 3)
    capture = replace(_capture(np.full((SIDE, SIDE), level), shot, read_e, 1), noise=noise)
    picture = pipeline.start(capture).fill()[:, MARGIN_PX:-MARGIN_PX, MARGIN_PX:-MARGIN_PX]
    spread = np.sqrt(shot * level + (read_e * shot) ** 2)
    assert picture.mean() == pytest.approx(_signal(capture).mean(), abs=0.5 * spread)


@pytest.mark.parametrize("read_e", [3.0, 6.0, 13.0])
def test_a_dark_frame_without_a_stated_noise_stays_dark(pipeline: Pipeline, read_e: float) -> None:
    capture = _capture(np.zeros((SIDE, SIDE)), 1e-3, read_e, 1)
    picture = pipeline.start(capture).fill()[:, MARGIN_PX:-MARGIN_PX, MARGIN_PX:-MARGIN_PX]
    assert abs(picture.mean()) < 1.6 * read_e * 1e-3, (
        "four times the noise, when chance was a slope"
    )


@pytest.mark.parametrize("level", [0.1, 0.4, 0.8])
@pytest.mark.parametrize("iso", [None, 100.0, 1600.0])
def test_a_flat_field_is_as_bright_as_it_was(
    pipeline: Pipeline, level: float, iso: float | None
) -> None:
    shot = 5e-5 * (iso or 400.0) / 100
    capture = replace(_capture(np.full((SIDE, SIDE), level), shot, 3.0, 1), iso=iso)
    picture = pipeline.start(capture).fill()[:, MARGIN_PX:-MARGIN_PX, MARGIN_PX:-MARGIN_PX]
    assert picture.mean() == pytest.approx(_signal(capture).mean(), rel=0.01)
    np.testing.assert_allclose(picture.mean(axis=(1, 2)), _signal(capture).mean(), rtol=0.025)
