"""Pictures of a smaller scale, and drafts: sizes, laws, places."""

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.errors import ContractError
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from tests.job_factory import SHAPE, made_mosaic, made_planes, start


def _level(share: float) -> np.ndarray:
    return np.full(SHAPE, 64 + share * (1023 - 64), np.uint16)


@pytest.mark.parametrize(("scale", "side"), [("1/2", 2), ("1/4", 4)])
def test_the_picture_has_a_part_of_the_pixels_on_either_side(
    bundle: Bundle, scale: str, side: int
) -> None:
    work = start(bundle, made_mosaic(), scale=scale)
    assert work.shape == (3, SHAPE[0] // side, SHAPE[1] // side)
    assert work.fill().shape == work.shape


@pytest.mark.parametrize(
    "choices",
    [{"scale": "1/2", "method": "wiener"}, {"scale": "1/4"}, {"quality": "draft", "strength": 0.0}],
    ids=str,
)
@pytest.mark.parametrize("level", [0.4, 1.0])
def test_flat_stays_flat_and_white_stays_white(
    bundle: Bundle, choices: dict[str, object], level: float
) -> None:
    even = {"color": "camera", "undistort": False, "vignetting": False}
    capture = made_mosaic(samples=_level(level), white_balance=(1.0, 1.0, 1.0))
    picture = start(bundle, capture, **choices, **even).fill()
    np.testing.assert_allclose(picture, level, atol=0.02)


def test_the_scaled_window_lies_where_the_mosaic_does(bundle: Bundle) -> None:
    whole, half = (start(bundle, made_mosaic(), scale=s).job.placement for s in ("1", "1/2"))
    assert half.kernel_scale == whole.kernel_scale / 2
    np.testing.assert_allclose(half.window.to_mm(0, 0), whole.window.to_mm(0.5, 0.5))
    last = whole.window.to_mm(SHAPE[1] - 1.5, SHAPE[0] - 1.5)
    np.testing.assert_allclose(half.window.to_mm(SHAPE[1] // 2 - 1, SHAPE[0] // 2 - 1), last)


def test_a_crop_is_a_part_of_the_whole(bundle: Bundle) -> None:
    """Its place on the sensor goes with it, and with it the kernels."""
    samples = np.asarray(made_mosaic().samples)
    pipeline = Pipeline(bundle, Options(scale="1/2"))
    crop = pipeline.capture_of(
        samples[10:42, 20:60], iso=100.0, white_balance=None, origin_px=(20, 10)
    )
    window = pipeline.start(crop).job.placement.window
    whole = start(bundle, made_mosaic(), scale="1/2").job.placement.window
    np.testing.assert_allclose(window.to_mm(0, 0), whole.to_mm(10, 5))


def test_a_developed_picture_averaged_is_the_smaller_one(bundle: Bundle) -> None:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    wave = 0.4 + 0.2 * np.sin(2 * np.pi * (x / 40 + y / 32))
    capture = made_mosaic(samples=(64 + wave * 959).astype(np.uint16))
    whole, half = (start(bundle, capture, scale=s, method="develop").fill() for s in ("1", "1/2"))
    means = whole.reshape(3, SHAPE[0] // 2, 2, SHAPE[1] // 2, 2).mean(axis=(2, 4))
    assert np.abs(half - means)[:, 2:-2, 2:-2].max() < 0.02


def test_planes_are_not_averaged(bundle: Bundle) -> None:
    with pytest.raises(ContractError, match="averages a mosaic"):
        start(bundle, made_planes(), scale="1/2")


def test_what_decides_the_work_otherwise_is_refused_beside_it() -> None:
    with pytest.raises(ContractError, match=r"leave max_seconds.*out"):
        Options(scale="1/2", max_seconds=1.0)
    with pytest.raises(ContractError, match=r"leave quality.*out"):
        Options(scale="1/2", quality="draft")
