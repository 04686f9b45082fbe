import cv2
import numpy as np
import pytest

from camkit.runtime.bank.spectrum import (
    apply_transfer,
    from_packed,
    inverse,
    multiply_conjugate,
    packed_places,
    packed_power,
    packed_spectrum,
    spread_weights,
    to_packed,
    transform,
)

SIZES = [(1, 1), (2, 2), (1, 5), (3, 1), (6, 4), (5, 8), (37, 37), (96, 96), (97, 60)]
FLOAT32 = 1e-6


def planes_of(size, seed=0):
    return np.random.default_rng(seed).standard_normal((3, *size)).astype(np.float32)


@pytest.mark.parametrize("size", SIZES)
def test_the_spectrum_is_that_of_numpy(size):
    planes = planes_of(size)
    wanted = np.fft.rfft2(planes.astype(np.float64))
    np.testing.assert_allclose(transform(planes), wanted, atol=FLOAT32 * np.abs(wanted).max())


@pytest.mark.parametrize("size", SIZES)
def test_the_inverse_gives_the_planes_back(size):
    planes = planes_of(size)
    np.testing.assert_allclose(inverse(transform(planes), size[1]), planes, atol=5e-6)


@pytest.mark.parametrize("size", SIZES)
def test_a_transfer_function_is_a_periodic_convolution(size):
    planes, kernel = planes_of(size), planes_of(size, seed=1)
    wanted = np.fft.irfft2(np.fft.rfft2(planes) * np.fft.rfft2(kernel), s=size)
    given = apply_transfer(planes, transform(kernel))
    np.testing.assert_allclose(given, wanted, atol=FLOAT32 * max(1, np.abs(wanted).max()))


@pytest.mark.parametrize("size", [(6, 4), (5, 8), (96, 96)])
def test_of_a_spectrum_of_no_real_picture_the_real_part_is_taken(size):
    rng = np.random.default_rng(2)
    shape = (3, size[0], size[1] // 2 + 1)
    half = (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)).astype(np.complex64)
    wanted = np.fft.irfft2(half.astype(np.complex128), s=size)
    np.testing.assert_allclose(inverse(half, size[1]), wanted, atol=FLOAT32)


def test_views_of_any_layout_are_transformed_without_change():
    planes = planes_of((20, 24))
    turned = planes[:, ::-1, ::-1]
    before = planes.copy()
    np.testing.assert_array_equal(transform(turned), transform(turned.copy()))
    np.testing.assert_array_equal(planes, before)


@pytest.mark.parametrize("offset", range(1, 17, 3))
def test_bits_do_not_depend_on_where_the_samples_lie_in_memory(offset):
    plane = planes_of((48, 48))[:1]
    moved = np.empty(plane.size + 32, np.float32)[offset : offset + plane.size].reshape(plane.shape)
    moved[:] = plane
    np.testing.assert_array_equal(transform(moved), transform(plane))


def test_opencv_keeps_its_own_number_of_threads():
    before = cv2.getNumThreads()
    transform(planes_of((64, 64)))
    assert cv2.getNumThreads() == before


@pytest.mark.parametrize("size", SIZES)
def test_real_weights_in_packed_planes_are_those_of_the_half_spectrum(size):
    planes = planes_of(size)
    fy, fx = np.fft.fftfreq(size[0])[:, None], np.fft.rfftfreq(size[1])[None]
    weights = np.exp(-3 * np.stack([fy**2 + fx**2] * 3)).astype(np.float32)
    wanted = inverse(transform(planes) * weights, size[1])
    packed = packed_spectrum(transform(planes), size[1])
    np.testing.assert_array_equal(packed, to_packed(planes))
    given = from_packed(packed * spread_weights(weights, size[1]))
    np.testing.assert_allclose(given, wanted, atol=5e-6)


@pytest.mark.parametrize("size", SIZES)
def test_a_product_with_a_conjugate_is_that_of_the_half_spectra(size):
    planes, other = planes_of(size), planes_of(size, seed=1)
    wanted = inverse(transform(planes) * np.conj(transform(other)), size[1])
    given = from_packed(multiply_conjugate(to_packed(planes), to_packed(other)))
    np.testing.assert_allclose(given, wanted, atol=FLOAT32 * max(1, np.abs(wanted).max()))


@pytest.mark.parametrize("size", SIZES)
def test_the_power_of_packed_planes_is_that_of_the_half_spectrum(size):
    half = transform(planes_of(size))
    power = np.square(half.real) + np.square(half.imag)
    given = packed_power(packed_spectrum(half, size[1]))
    np.testing.assert_array_equal(given, spread_weights(power, size[1]))


@pytest.mark.parametrize("size", [(6, 4), (37, 37), (96, 96), (97, 60)])
def test_places_in_packed_planes_are_those_of_their_frequencies(size):
    planes = planes_of(size)
    half, packed = transform(planes), to_packed(planes)
    rows, columns = np.indices(half.shape[1:])
    own = ((rows == 0) | (2 * rows == size[0])) & ((columns == 0) | (2 * columns == size[1]))
    asked = ~own & (2 * columns < size[1])
    real, imaginary = packed_places(rows[asked], columns[asked], size)
    flat = packed.reshape(3, -1)
    np.testing.assert_array_equal(flat[:, real], half.real[:, asked])
    np.testing.assert_array_equal(np.abs(flat[:, imaginary]), np.abs(half.imag[:, asked]))
