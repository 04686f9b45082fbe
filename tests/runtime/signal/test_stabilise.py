import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.noise import NoiseModel
from camkit.runtime.rows import ArrayRows
from camkit.runtime.signal.stabilise import StackedRows, familiar_noise, stabilise, unstabilise
from tests.psf_factory import with_noise

NOISE = NoiseModel(shot=(4e-5, 2e-5, 3e-5), read_variance=(4e-8, 1e-8, 2e-8))


def test_inverse_gives_the_picture_back_including_negatives_above_the_noise_floor():
    planes = np.random.default_rng(0).random((3, 20, 30), dtype=np.float32) * 8 - 1e-4
    again = unstabilise(stabilise(planes, NOISE), NOISE)
    np.testing.assert_allclose(again, planes, atol=4e-6)


@pytest.mark.parametrize("gain", [1, 16, 128])
def test_noise_has_the_same_deviation_at_any_gain_and_level(gain):
    rng = np.random.default_rng(1)
    noise = NoiseModel(
        shot=tuple(v * gain for v in NOISE.shot),
        read_variance=tuple(v * gain**2 for v in NOISE.read_variance),
    )
    for level in (0.05, 0.2, 0.8):
        flat = with_noise(np.full((3, 300, 300), level, dtype=np.float32), noise, rng)
        deviation = stabilise(flat, noise, scale=64).std(axis=(1, 2))
        np.testing.assert_allclose(deviation, 0.5 / 64, rtol=0.03)


def test_values_below_every_noise_become_zero():
    planes = np.full((3, 2, 2), -1, dtype=np.float32)
    np.testing.assert_array_equal(stabilise(planes, NOISE), 0)


def test_planes_are_not_changed():
    planes = np.ones((3, 4, 4), dtype=np.float32)
    stabilise(planes, NOISE)
    unstabilise(planes, NOISE)
    np.testing.assert_array_equal(planes, 1)


def test_noise_without_shot_and_other_shapes_are_refused():
    planes = np.ones((3, 4, 4), dtype=np.float32)
    silent = NoiseModel(shot=(0, 0, 0), read_variance=(1e-8,) * 3)
    with pytest.raises(ContractError, match="shot noise"):
        stabilise(planes, silent)
    with pytest.raises(ContractError, match="planes"):
        unstabilise(planes[0], NOISE)


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_stacked_rows_are_their_sources_stabilised_one_below_the_other(threads):
    rng = np.random.default_rng(2)
    planes, restored = (rng.random((3, 70, 9000), dtype=np.float32) for _ in range(2))
    sources = [ArrayRows(planes), ArrayRows(restored)]
    rows = StackedRows(sources, [NOISE, NOISE], scale=32.0, threads=threads)
    assert rows.shape == (6, 70, 9000)
    expected = [stabilise(part[:, 3:67], NOISE, scale=32.0) for part in (planes, restored)]
    np.testing.assert_array_equal(rows.read(3, 67), np.concatenate(expected))


@pytest.mark.parametrize("channels", [1, 2, 7])
def test_any_number_of_channels_is_stabilised_each_by_its_own_noise(channels):
    rng = np.random.default_rng(5)
    noise = NoiseModel(
        shot=tuple(rng.uniform(1e-5, 1e-4, channels)),
        read_variance=tuple(rng.uniform(1e-8, 1e-6, channels)),
    )
    planes = rng.random((channels, 9, 13), dtype=np.float32)
    stable = stabilise(planes, noise)
    np.testing.assert_allclose(unstabilise(stable, noise), planes, atol=4e-6)
    for c in range(channels):
        alone = NoiseModel(shot=noise.shot[c : c + 1], read_variance=noise.read_variance[c : c + 1])
        np.testing.assert_array_equal(stabilise(planes[c : c + 1], alone)[0], stable[c])
    with pytest.raises(ContractError, match=rf"planes must be \({channels}, h, w\)"):
        stabilise(np.ones((channels + 1, 2, 2), np.float32), noise)


@pytest.mark.parametrize("threads", [1, 2])
def test_any_planes_are_stacked_and_without_noises_as_they_are(threads):
    rng = np.random.default_rng(6)
    parts = [rng.random((c, 70, 900), dtype=np.float32) for c in (1, 4, 2)]
    rows = StackedRows([ArrayRows(part) for part in parts], None, threads=threads)
    assert rows.shape == (7, 70, 900)
    np.testing.assert_array_equal(rows.read(3, 67), np.concatenate(parts)[:, 3:67])
    noises = [NoiseModel(shot=(1e-4,) * c, read_variance=(1e-7,) * c) for c in (1, 4, 2)]
    stable = StackedRows([ArrayRows(part) for part in parts], noises, threads=threads)
    wanted = [stabilise(part, noise) for part, noise in zip(parts, noises, strict=True)]
    np.testing.assert_array_equal(stable.read(0, 70), np.concatenate(wanted))


def test_stacked_rows_need_sources_of_one_size():
    with pytest.raises(ContractError, match="one size"):
        StackedRows([ArrayRows(np.zeros((3, 4, w), np.float32)) for w in (4, 5)], [NOISE, NOISE])


def test_undoing_in_place_gives_the_bits_of_a_new_array():
    stable = np.random.default_rng(4).random((3, 9, 90), dtype=np.float32)
    expected = unstabilise(stable, NOISE, scale=32.0)
    assert unstabilise(stable, NOISE, scale=32.0, out=stable) is stable
    np.testing.assert_array_equal(stable, expected)


@pytest.mark.parametrize(
    ("read_e", "trained", "black_e"),
    [
        (3.0, [3.0], 3.0),
        (9.0, [3.0], 9.0),
        (0.5, [3.0], 3.0),
        (20.0, [3.0], 9.0),
        (1.5, [1.0, 2.0], 1.5),
        (4.0, [0.0], 1.0),
        (0.0, [0.0], 0.0),
    ],
)
def test_black_lies_where_a_network_knows_it(read_e, trained, black_e):
    shot = 1e-3
    noise = NoiseModel(shot=(shot,), read_variance=((read_e * shot) ** 2,))
    familiar = familiar_noise(noise, trained)
    black = np.zeros((1, 1, 1), dtype=np.float32)
    assert stabilise(black, familiar, scale=1).item() == pytest.approx(black_e)
    assert familiar.read_variance[0] >= noise.read_variance[0] * (1 - 1e-12)
    light = np.linspace(0, 1, 50, dtype=np.float32)[None, None]
    np.testing.assert_allclose(unstabilise(stabilise(light, familiar), familiar), light, atol=1e-6)
    if read_e == black_e:
        assert familiar == noise
