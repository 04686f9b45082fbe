import threading
import weakref

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.bank.blocks import (
    Block,
    BlockBank,
    LocalPsf,
    binned_otf,
    cut_block_px,
    lay_spans,
    mirror_otf,
    taper_edges,
    to_otf,
)
from camkit.runtime.bank.psf import FieldKernels, color_kernels
from camkit.runtime.binning import Binning
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.rows import ArrayRows, RollingRows
from tests.psf_factory import (
    PITCH_UM,
    coma_kernels,
    gaussian_kernel,
    grid_psf,
    local_psf,
    psnr_db,
    streak_kernel,
    texture,
    uniform_psf,
)

SIZES = st.integers(1, 300)


def keep(block):
    return block.samples


@given(SIZES, st.sampled_from([(16, 0), (16, 1), (16, 3), (16, 8), (32, 10), (64, 20)]))
@settings(deadline=None, max_examples=60)
def test_windows_sum_to_one_and_only_neighbours_overlap(size_px, layout):
    total = np.zeros(size_px)
    spans = lay_spans(size_px, *layout)
    for span in spans:
        assert span.index.min() >= 0
        assert span.index.max() < size_px
        total[span.start + span.inner.start : span.start + span.inner.stop] += span.weights
    np.testing.assert_allclose(total, 1, atol=1e-6)


@given(SIZES)
@settings(deadline=None, max_examples=30)
def test_block_samples_inside_the_picture_are_those_of_the_picture(size_px):
    for span in lay_spans(size_px, 32, 10):
        at = np.arange(span.start, span.start + 32)
        inside = (at >= 0) & (at < size_px)
        np.testing.assert_array_equal(span.index[inside], at[inside])


def test_the_grid_is_centred_on_the_sensor():
    spans = lay_spans(6000, 512, 160)
    centres = np.array([s.centre for s in spans])
    np.testing.assert_array_equal(centres + centres[::-1], 5999)
    assert len(spans) == 17


@pytest.mark.parametrize("layout", [(0, 32, 10), (100, 32, 17), (100, 0, 0), (100, 32, -1)])
def test_a_grid_that_cannot_be_is_refused(layout):
    with pytest.raises(ContractError, match="blocks need"):
        lay_spans(*layout)


def test_otf_is_the_transform_of_the_kernel_about_its_centre():
    kernel = coma_kernels()[0][-1][:, 2:-1]
    block = np.zeros((3, 40, 40))
    _, kh, kw = kernel.shape
    for row in range(kh):
        for col in range(kw):
            block[:, (row - kh // 2) % 40, (col - kw // 2) % 40] = kernel[:, row, col]
    np.testing.assert_allclose(to_otf(kernel, 40), np.fft.rfft2(block), atol=1e-6)


@pytest.mark.parametrize("turn_deg", [0.0, 75.0, 200.0])
@pytest.mark.parametrize("channels", [1, 2, 5])
def test_a_product_with_the_otf_is_direct_convolution(turn_deg, channels):
    """Light falls on the side to which the streak points, on a block that is periodic."""
    kernels = np.stack([streak_kernel(turn_deg + 20 * c, 6, 7) for c in range(channels)])
    picture = np.random.default_rng(0).random((channels, 32, 32), dtype=np.float32)
    direct = np.zeros((channels, 32, 32))
    for dy in range(-7, 8):
        for dx in range(-7, 8):
            weight = kernels[:, dy + 7, dx + 7, None, None]
            direct += weight * np.roll(picture, (dy, dx), axis=(1, 2))
    product = np.fft.irfft2(np.fft.rfft2(picture) * to_otf(kernels, 32), s=(32, 32))
    np.testing.assert_allclose(product, direct, atol=2e-6)


def test_the_otf_of_a_rectangular_kernel_is_about_its_own_centre():
    kernel = np.zeros((1, 3, 9), np.float32)
    kernel[0, 0, 8] = 1
    product = np.fft.irfft2(to_otf(kernel, 16), s=(16, 16))
    assert np.unravel_index(product.argmax(), product.shape) == (0, 15, 4)


@pytest.mark.parametrize("flip_x", [False, True])
@pytest.mark.parametrize("flip_y", [False, True])
@pytest.mark.parametrize("size", [40, 41])
def test_mirrored_otf_is_that_of_the_mirrored_kernel(flip_x, flip_y, size):
    kernel = np.roll(coma_kernels()[0][-1], 2, axis=-1)
    mirrored = kernel[:, :: -1 if flip_y else 1, :: -1 if flip_x else 1]
    np.testing.assert_allclose(
        mirror_otf(to_otf(kernel, size), flip_x=flip_x, flip_y=flip_y),
        to_otf(mirrored, size),
        atol=1e-6,
    )


def test_a_kernel_larger_than_its_block_is_refused():
    with pytest.raises(ContractError, match="does not fit"):
        to_otf(gaussian_kernel(2.0, 8), 16)


def test_taper_leaves_the_inside_alone_and_joins_opposite_edges():
    samples = np.broadcast_to(np.linspace(0, 1, 64, dtype=np.float32), (3, 64, 64))
    tapered = taper_edges(samples, to_otf(gaussian_kernel(8.0, 24), 64), 12)
    np.testing.assert_allclose(tapered[:, 12:-12, 12:-12], samples[:, 12:-12, 12:-12], atol=1e-6)
    jump = np.abs(tapered[:, 32, 0] - tapered[:, 32, -1]).max()
    assert jump < 0.25 * np.abs(samples[:, 32, 0] - samples[:, 32, -1]).max()


@pytest.mark.parametrize(("size", "ring"), [(3, 40), (64, 0)])
def test_without_a_ring_nothing_is_tapered(size, ring):
    samples = np.ones((3, size, size), dtype=np.float32)
    assert taper_edges(samples, to_otf(gaussian_kernel(1.0, 1), size), ring) is samples


@pytest.mark.parametrize("size", [(1, 1), (31, 17), (17, 31), (1, 90), (64, 64), (130, 97)])
def test_a_bank_that_keeps_its_blocks_gives_the_picture_back(size):
    planes = texture(size[1], size[0])
    psf = local_psf(gaussian_kernel(1.0, 3), np.zeros(1), size)
    kept = BlockBank(psf, keep, block_px=32, overlap_px=12).restore_array(planes)
    np.testing.assert_allclose(kept, planes, atol=1e-6)


@given(st.integers(1, 150), st.integers(1, 150), st.integers(1, 40), st.integers(1, 3))
@settings(deadline=None, max_examples=25)
def test_bits_do_not_depend_on_threads_or_on_how_rows_arrive(h, w, band_rows, threads):
    planes = texture(h, w)
    psf = local_psf(*coma_kernels(radius_px=6), (w, h))
    layout = {"block_px": 48, "overlap_px": 16}

    def sharpen(block):
        return 2 * block.samples - np.roll(block.samples, 1, axis=2) * block.otf.real[0, 0, 1]

    whole = BlockBank(psf, sharpen, **layout).restore_array(planes)
    bands = (planes[:, top : top + band_rows] for top in range(0, h, band_rows))
    source = RollingRows(planes.shape, bands).reader()
    bank = BlockBank(psf, sharpen, threads=threads, **layout)
    np.testing.assert_array_equal(np.concatenate(list(bank.restore_bands(source)), axis=1), whole)


def test_every_block_gets_the_psf_of_its_own_place():
    """A bank whose filter blurs, on a grid of points, scatters each point outward."""
    size = 192
    points = np.zeros((3, size, size), dtype=np.float32)
    places = [(40, 40), (40, 150), (150, 40), (150, 150), (96, 150)]
    for row, col in places:
        points[:, row, col] = 1

    def blur(block):
        spectrum = np.fft.rfft2(block.samples) * block.otf
        return np.fft.irfft2(spectrum, s=block.samples.shape[1:]).astype(np.float32)

    psf = local_psf(*coma_kernels(radius_px=10, tail_px=8), (size, size))
    blurred = BlockBank(psf, blur, block_px=64, overlap_px=32).restore_array(points)
    for row, col in places:
        patch = blurred[1, row - 12 : row + 13, col - 12 : col + 13]
        at = np.arange(-12, 13)
        shift = np.array([patch.sum(axis=0) @ at, patch.sum(axis=1) @ at]) / patch.sum()
        outward = np.array([col - 95.5, row - 95.5])
        assert shift @ outward / np.hypot(*outward) > 0.95 * np.hypot(*shift)
        assert np.hypot(*shift) > 0.8


def test_one_psf_for_all_places_is_mirrored_in_no_quadrant():
    size = 192
    points = np.zeros((3, size, size), dtype=np.float32)
    places = [(40, 40), (40, 150), (150, 40), (150, 150)]
    for row, col in places:
        points[:, row, col] = 1
    seen = []

    def keep_otf(block):
        seen.append(block.otf)
        return block.samples

    kernels, _ = coma_kernels(radius_px=10, tail_px=8)
    psf = local_psf(kernels[-1:], np.zeros(1), (size, size))
    BlockBank(psf, keep_otf, block_px=64, overlap_px=32).restore_array(points)
    wanted = to_otf(kernels[-1], 64)
    assert np.abs(wanted - mirror_otf(wanted, flip_x=False, flip_y=True)).max() > 1e-2
    assert all(np.abs(otf - wanted).max() < 1e-6 for otf in seen)


def _streaks(symmetry, channels):
    """Give fields of streaks: one, or four in four corners."""
    at_mm = np.array([-0.4, 0.4])
    turned = np.stack([streak_kernel(turn) for turn in (20.0, 110.0, 200.0, 290.0)])
    psf = {
        "uniform": uniform_psf(turned[0]),
        "grid": grid_psf(turned.reshape(2, 2, 21, 21), at_mm, at_mm),
    }[symmetry]
    return color_kernels(psf, np.array([0.5, 0.6]), np.ones((channels, 2)))


def _whole_sensor(width, height, axis_px=None):
    return SensorWindow(
        size_px=(width, height),
        origin_px=(0, 0),
        sensor_size_px=(width, height),
        pitch_um=PITCH_UM,
        axis_px=axis_px,
    )


@pytest.mark.parametrize("symmetry", ["uniform", "grid"])
@pytest.mark.parametrize("channels", [1, 4])
@pytest.mark.parametrize("axis_px", [None, (20.0, 150.0)])
def test_every_block_gets_the_streak_of_its_own_place_and_no_mirror_image(
    symmetry, channels, axis_px
):
    fields, window = _streaks(symmetry, channels), _whole_sensor(160, 160, axis_px)
    seen = []

    def keep_otf(block):
        seen.append(block.otf)
        return block.samples

    bank = BlockBank(LocalPsf(kernels=fields, window=window), keep_otf, block_px=64, overlap_px=32)
    bank.restore_array(np.zeros((channels, 160, 160), np.float32))
    centres = [span.centre for span in lay_spans(160, 64, 32)]
    places = [window.to_mm(x, y) for y in centres for x in centres]
    wanted = [to_otf(fields.at(float(x_mm), float(y_mm)), 64) for x_mm, y_mm in places]
    assert len(seen) == len(wanted)
    np.testing.assert_allclose(seen, wanted, atol=1e-6)


@given(st.integers(1, 80), st.integers(1, 80), st.integers(1, 40), st.integers(1, 5))
@settings(deadline=None, max_examples=15)
def test_bits_of_a_grid_do_not_depend_on_threads_or_on_how_rows_arrive(h, w, band_rows, channels):
    planes = np.random.default_rng(h * w).random((channels, h, w), dtype=np.float32)
    window = SensorWindow(
        size_px=(w, h), origin_px=(3, 5), sensor_size_px=(200, 200), pitch_um=PITCH_UM
    )
    psf = LocalPsf(kernels=_streaks("grid", channels), window=window)
    layout = {"block_px": 48, "overlap_px": 16}

    def sharpen(block):
        return 2 * block.samples - np.roll(block.samples, 1, axis=2) * block.otf.real[0, 0, 1]

    whole = BlockBank(psf, sharpen, **layout).restore_array(planes)
    bands = (planes[:, top : top + band_rows] for top in range(0, h, band_rows))
    bank = BlockBank(psf, sharpen, threads=2, **layout)
    source = RollingRows(planes.shape, bands).reader()
    np.testing.assert_array_equal(np.concatenate(list(bank.restore_bands(source)), axis=1), whole)


def test_without_an_axis_blocks_have_the_bits_of_one_in_the_middle():
    planes = texture(90, 130)
    kernels, heights_mm = coma_kernels(radius_px=6)
    fields = FieldKernels(kernels=kernels, field_heights_mm=heights_mm)
    made = [
        BlockBank(
            LocalPsf(kernels=fields, window=_whole_sensor(130, 90, axis_px)),
            lambda block: block.samples * block.otf.real[0, 0, 1],
            block_px=48,
            overlap_px=16,
        ).restore_array(planes)
        for axis_px in (None, (64.5, 44.5), (60.0, 44.5))
    ]
    np.testing.assert_array_equal(made[0], made[1])
    assert (made[0] != made[2]).any()


def test_saturated_samples_reach_the_block_they_lie_in():
    saturated = np.zeros((70, 90), dtype=bool)
    saturated[60, 80] = True
    seen = []

    def note(block):
        seen.append(0 if block.unknown is None else int(block.unknown.sum()))
        return block.samples

    psf = local_psf(gaussian_kernel(1.0, 3), np.zeros(1), (90, 70))
    bank = BlockBank(psf, note, block_px=32, overlap_px=8)
    bank.restore_array(texture(70, 90), saturated)
    assert 0 < np.count_nonzero(seen) <= 4


def test_a_picture_of_another_size_is_refused():
    psf = local_psf(gaussian_kernel(1.0, 3), np.zeros(1), (90, 70))
    bank = BlockBank(psf, keep, block_px=32, overlap_px=8)
    with pytest.raises(ContractError, match="bank is for"):
        list(bank.restore_bands(ArrayRows(texture(70, 91))))


def test_a_failing_filter_ends_the_run_with_its_own_error():
    def fail(block):
        raise ContractError("no")

    psf = local_psf(gaussian_kernel(1.0, 3), np.zeros(1), (90, 70))
    bank = BlockBank(psf, fail, block_px=32, overlap_px=8, threads=2)
    with pytest.raises(ContractError, match="no"):
        bank.restore_array(texture(70, 90))


def test_psnr_of_the_tests_is_the_usual_one():
    assert psnr_db(np.zeros((3, 8, 8)), np.full((3, 8, 8), 0.1)) == pytest.approx(20, abs=1e-6)


@pytest.mark.parametrize("threads", [1, 2])
def test_few_places_are_held_and_each_is_made_once_a_row(threads: int) -> None:
    class Known:
        pass

    made: list[float] = []
    living: weakref.WeakSet[Known] = weakref.WeakSet()

    def know(_: object, height_mm: float) -> Known:
        made.append(height_mm)
        known = Known()
        living.add(known)
        return known

    held: list[int] = []

    def note(block: Block) -> FloatArray:
        held.append(len(living))
        return block.samples

    psf = local_psf(*coma_kernels(radius_px=4, tail_px=3), (600, 20))
    layout = {"block_px": 32, "overlap_px": 8, "threads": threads}
    BlockBank(psf, note, knowledge=know, **layout).restore_array(np.zeros((3, 20, 600), np.float32))
    places = (len(held) + 1) // 2
    assert len(made) == places > 10, "two mirrored blocks share a place"
    # that of a block, the next, and one whose last block just ended, of every thread
    assert max(held) <= 2 + threads


def test_a_bank_that_waits_between_bands_owns_no_threads() -> None:
    """Else the collector, closing an abandoned generator, could wait for a thread that waits."""
    psf = local_psf(gaussian_kernel(1.0, 3), np.zeros(1), (90, 200))
    bank = BlockBank(psf, keep, block_px=32, overlap_px=8, threads=2)
    bands = bank.restore_bands(ArrayRows(texture(200, 90)))
    before = threading.active_count()
    next(bands)
    assert threading.active_count() == before


@pytest.mark.parametrize(
    ("block_px", "size_px", "wanted"),
    [(384, (96, 64), 384), (512, (96, 64), 512), (8192, (96, 64), 512), (8192, (9000, 9000), 8192)],
)
def test_no_block_is_much_larger_than_its_picture(block_px, size_px, wanted):
    assert cut_block_px(block_px, 128, size_px) == wanted


def test_a_cut_block_covers_the_picture_and_its_borders():
    side = cut_block_px(8192, 128, (1500, 1000))
    assert 1500 + 2 * 56 <= side < 1700
    assert side % 4 == 0
    assert len(lay_spans(1500, side, 128)) == 1


def test_the_otf_between_means_is_that_of_the_fine_kernel_at_the_same_frequencies() -> None:
    kernel = np.random.default_rng(2).random((3, 9, 7)).astype(np.float32)
    kernel /= kernel.sum(axis=(1, 2), keepdims=True)
    binning, block_px = Binning(side_px=2, cfa="RGGB"), 16
    otf = binned_otf(kernel, block_px, binning)
    fine = to_otf(kernel, 2 * block_px)
    low = np.concatenate([fine[:, : block_px // 2], fine[:, -block_px // 2 :]], axis=1)
    expected = low[:, :, : block_px // 2 + 1]
    np.testing.assert_allclose(otf[1], expected[1], atol=1e-5)
    rows, columns = np.fft.fftfreq(block_px) / 2, np.fft.rfftfreq(block_px) / 2
    red = binning.transfer(0, rows)[:, None] * binning.transfer(0, columns)
    np.testing.assert_allclose(otf[0], red * expected[0], atol=1e-5)
    assert otf[:, 0, 0] == pytest.approx(1.0, abs=1e-5)
