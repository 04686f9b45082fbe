"""What a capture holds: detail beyond the noise, on a lattice that its size alone decides."""

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.noise import NoiseModel
from camkit.runtime.capture import Capture
from camkit.runtime.content import (
    BLACK,
    CELL_PX,
    SPILL,
    TELLABLE,
    Content,
    cell_area_px,
    lattice_shape,
    measure_content,
)
from camkit.runtime.geometry.sensor_window import SensorWindow

GAINS = (2.0, 1.0, 1.5)
WHITE = 60_000


def _content(
    signal: FloatArray, noise: NoiseModel, *, gains: tuple[float, float, float]
) -> Content:
    """Measure a float mosaic whose colours all hold `signal` after white balance."""
    height, width = signal.shape
    capture = Capture(
        samples=signal.astype(np.float32),
        cfa="RGGB",
        black_level=np.zeros((2, 2), np.float32),
        white_level=1.0,
    )
    window = SensorWindow(
        size_px=(width, height), origin_px=(0, 0), sensor_size_px=(width, height), pitch_um=5.0
    )
    return measure_content(capture, noise, gains, window)


def _noise(shot: float, read: float) -> NoiseModel:
    return NoiseModel(shot=(shot,) * 3, read_variance=(read,) * 3)


def test_flat_noise_is_all_noise_and_no_detail() -> None:
    model = _noise(1e-4, 1e-6)
    level = 0.3
    variance = 1e-4 * level + 1e-6
    signal = level + np.sqrt(variance) * np.random.default_rng(0).standard_normal((512, 512))
    content = _content(signal.astype(np.float32), model, gains=(1.0, 1.0, 1.0))
    # Mean over R, G, B of the squared step 2 var (1 / (2 sqrt(x)))^2; green averages two samples.
    closed = variance / (2 * (level + BLACK)) * (1 + 0.5 + 1) / 3
    np.testing.assert_allclose(content.noise, closed, rtol=0.02)
    np.testing.assert_allclose(content.level, level, rtol=0.01)
    assert (content.detail <= 0.08 * content.noise).all()
    assert (content.detail >= TELLABLE * content.noise * 0.999).all()


def test_detail_of_stripes_is_their_squared_step() -> None:
    signal = np.full((256, 256), 0.25, np.float32)
    signal[:, 2::4] = signal[:, 3::4] = 0.36
    content = _content(signal, _noise(1e-12, 0.0), gains=(1.0, 1.0, 1.0))
    step = np.square(np.sqrt(0.36 + BLACK) - np.sqrt(0.25 + BLACK))
    # Every horizontal step but the first of each row, no vertical one: half of the squared step.
    assert content.detail[0, 0] == pytest.approx(step / 2 * 127 / 128, rel=1e-3)


def test_only_the_cell_with_texture_has_detail() -> None:
    signal = np.full((512, 768), 0.2, np.float32)
    signal[256:, 256:512] += 0.1 * np.random.default_rng(1).random((256, 256), dtype=np.float32)
    content = _content(signal, _noise(1e-6, 0.0), gains=(1.0, 1.0, 1.0))
    others = np.ones((2, 3), bool)
    others[1, 1] = False
    assert content.detail[1, 1] > 20 * content.detail[others].max()


def test_a_cell_does_not_see_the_rest_of_the_capture() -> None:
    signal = np.random.default_rng(2).random((512, 512), dtype=np.float32)
    whole = _content(signal, _noise(1e-4, 1e-6), gains=GAINS)
    part = _content(signal[:256, :256], _noise(1e-4, 1e-6), gains=GAINS)
    for name in ("level", "detail", "noise", "clipped"):
        assert getattr(whole, name)[0, 0] == pytest.approx(getattr(part, name)[0, 0], rel=1e-6)


def test_clipped_cells_are_counted() -> None:
    samples = np.full((256, 512), WHITE // 4, np.uint16)
    samples[:, 256:] = WHITE
    capture = Capture(
        samples=samples,
        cfa="GRBG",
        black_level=np.zeros((2, 2), np.float32),
        white_level=float(WHITE),
    )
    window = SensorWindow(
        size_px=(512, 256), origin_px=(0, 0), sensor_size_px=(1024, 512), pitch_um=5.0
    )
    content = measure_content(capture, _noise(1e-4, 1e-6), GAINS, window)
    np.testing.assert_array_equal(content.clipped, [[0.0, 1.0]])
    assert content.clipped_fraction == 0.5
    assert content.sensor_share == 0.25


@pytest.mark.parametrize("shape", [(1, 1), (3, 5), (257, 255), (300, 514)])
def test_odd_and_tiny_captures_have_finite_cells(shape: tuple[int, int]) -> None:
    signal = np.random.default_rng(3).random(shape, dtype=np.float32)
    signal[0, 0] = np.nan
    content = _content(signal, _noise(1e-4, 1e-6), gains=GAINS)
    assert content.detail.shape == lattice_shape(*shape)
    assert content.to_json()["cells"] == content.detail.size


def test_planes_are_measured_like_a_mosaic() -> None:
    planes = np.full((3, 256, 512), 0.2, np.float32)
    planes[:, :, 256:] += 0.1 * np.random.default_rng(4).random((256, 256), dtype=np.float32)
    capture = Capture(
        samples=planes, cfa=None, black_level=np.zeros(3, np.float32), white_level=1.0
    )
    window = SensorWindow(
        size_px=(512, 256), origin_px=(0, 0), sensor_size_px=(512, 256), pitch_um=5.0
    )
    content = measure_content(capture, _noise(1e-6, 0.0), (1.0, 1.0, 1.0), window)
    assert content.detail[0, 1] > 20 * content.detail[0, 0]


def test_blur_brings_detail_into_the_cells_around_but_no_further() -> None:
    signal = np.full((CELL_PX, 4 * CELL_PX), 0.2, np.float32)
    signal[:, :CELL_PX] += 0.2 * np.random.default_rng(5).random((CELL_PX, CELL_PX))
    content = _content(signal, _noise(1e-6, 0.0), gains=(1.0, 1.0, 1.0))
    own, blurred = content.detail[0], content.blurred_detail[0]
    np.testing.assert_allclose(blurred[0], (1 + SPILL) * own[0])
    np.testing.assert_allclose(blurred[1], own[1] + SPILL * own[0])
    np.testing.assert_allclose(blurred[3], (1 + SPILL) * own[3])


def test_cell_areas_fill_the_picture() -> None:
    area = cell_area_px(600, 300)
    assert area.sum() == 600 * 300
    assert area[0, 0] == CELL_PX**2
    assert area[2, 1] == (600 - 512) * (300 - 256)


def test_field_of_the_middle_is_zero_and_grows_outwards() -> None:
    content = _content(np.full((768, 768), 0.2, np.float32), _noise(1e-4, 0.0), gains=GAINS)
    assert content.field[1, 1] == pytest.approx(0, abs=1e-12)
    # The middle of a corner cell lies two thirds of the way to the corner.
    assert content.field[0, 0] == pytest.approx(2 / 3, rel=1e-6)


def test_a_window_of_another_size_is_refused() -> None:
    capture = Capture(
        samples=np.zeros((8, 8), np.float32),
        cfa="RGGB",
        black_level=np.zeros((2, 2), np.float32),
        white_level=1.0,
    )
    window = SensorWindow(size_px=(9, 8), origin_px=(0, 0), sensor_size_px=(9, 8), pitch_um=5.0)
    with pytest.raises(ContractError, match="window"):
        measure_content(capture, _noise(1e-4, 0.0), GAINS, window)


def test_a_single_clipped_sample_is_seen_wherever_it_is() -> None:
    samples = np.full((200, 330), 900, np.uint16)
    samples[199, 329] = samples[70, 31] = WHITE
    capture = Capture(
        samples=samples, cfa="RGGB", black_level=np.zeros((2, 2), np.float32), white_level=WHITE
    )
    window = SensorWindow(
        size_px=(330, 200), origin_px=(0, 0), sensor_size_px=(330, 200), pitch_um=5.0
    )
    lights = measure_content(capture, _noise(1e-4, 1e-6), GAINS, window).lights
    assert lights.shape == (7, 11)
    assert sorted(zip(*np.nonzero(lights), strict=True)) == [(2, 0), (6, 10)]
