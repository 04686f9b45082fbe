"""A round PSF comes back from an edge; what an edge does not tell is refused."""

from pathlib import Path

import numpy as np
import pytest
from scipy import special

from camkit.calibration.darks import Darks
from camkit.calibration.edge_psf import Bins, RoundPsf, fit_edge, measure_edge
from camkit.calibration.measured import PsfOptions
from camkit.errors import ContractError, DecodeError
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.merging.survey import Survey, survey
from tests.camkit.calibration.haze_factory import Hazy
from tests.camkit.calibration.point_factory import exposed, mosaic_of, write_mosaic
from tests.data_folder import data_path

FOUR_UM = PsfOptions(pixel_pitch_um=4.0)
CLEAR = Hazy(core=1.0, side=300, x=152.3, y=149.1)
FWHM = 2 * np.sqrt(2 * np.log(2))


def _edge(folder: Path, optics: Hazy, *, peak: float = 0.8, angle_rad: float = 0.1) -> Survey:
    files = optics.write(folder, optics.edge_planes(angle_rad), peak=peak, times_s=(1.0,))
    return survey(files, None, alike=True)


def _fitted(spreads: tuple[float, ...], shares: tuple[float, ...], dark: float = 0.0) -> RoundPsf:
    """Fit a sum of Gaussians seen without noise."""
    y, x = np.indices((120, 800)).astype(np.float64)
    distance = ((x - 400.2) * np.cos(0.1) - (y - 59.5) * np.sin(0.1)).ravel()
    values = dark + 0.5 * sum(a * special.ndtr(distance / s) for s, a in zip(spreads, shares, strict=True))  # noqa: E501 # fmt: skip
    strip = np.zeros(distance.size, dtype=np.intp)
    bins = Bins.of(distance, np.asarray(values), np.full(distance.size, 1e8), strip)
    return fit_edge(bins.profile(), dark).psf


@pytest.mark.parametrize("spread_px", [0.6, 0.85, 1.37, 3.0])
def test_the_edge_of_a_gaussian_gives_the_gaussian(spread_px: float) -> None:
    found = _fitted((spread_px,), (1.0,))
    kernel = found.kernel(15)
    y, x = np.mgrid[-15:16, -15:16]
    truth = np.exp(-(y**2 + x**2) / (2 * spread_px**2))
    truth /= truth.sum()
    assert np.abs(kernel - truth).max() < 0.02 * truth.max()
    assert found.share_within(spread_px) == pytest.approx(1 - np.exp(-0.5), abs=0.005)


def test_a_gaussian_and_wide_haze_are_told_apart_with_their_shares() -> None:
    found = _fitted((1.3, 70.0), (0.15, 0.85), dark=0.02)
    truth = 0.15 + 0.85 * -np.expm1(-((10 / 70) ** 2) / 2)
    assert found.share_within(10.0) == pytest.approx(truth, abs=0.002)
    assert found.share_within(70.0) == pytest.approx(0.15 + 0.85 * (1 - np.exp(-0.5)), abs=0.005)


@pytest.mark.parametrize("spread_px", [0.3, 0.9, 4.0])
def test_kernels_keep_the_shares_of_light(spread_px: float) -> None:
    psf = RoundPsf(spreads_px=np.array([spread_px, 30.0]), shares=np.array([0.4, 0.6]))
    kernel = psf.kernel(200)
    assert kernel.sum() == pytest.approx(1, abs=1e-9)
    y, x = np.mgrid[-200:201, -200:201]
    assert kernel[np.hypot(y, x) <= 16].sum() == pytest.approx(psf.share_within(16.0), abs=0.004)


def test_a_public_edge_of_known_width_is_as_wide() -> None:
    # its width is stated along the rows; the edge lies at 16.776550 degrees from the columns
    path = data_path("lens/slanted_edge_angle16.78_fwhm2.10.tif")
    mosaic = MosaicOptions(cfa="RGGB", black_level=0, white_level=65535)
    found = measure_edge(survey([path], [1.0], mosaic=mosaic, alike=True), FOUR_UM, None)
    half = found.side_px // 2
    for kernel, colour in zip(found.psf.kernels[0, 0], found.colours, strict=True):
        # of a Gaussian: the light of the middle sample
        spread_px = 1 / np.sqrt(2 * np.pi * kernel[half, half])
        assert FWHM * spread_px / np.cos(np.radians(16.776550)) == pytest.approx(2.101313, abs=0.01)
        assert colour.reblurred is not None
        assert colour.reblurred.rest < 2e-4


@pytest.mark.parametrize("angle_rad", [0.05, 0.4, 1.4, -0.3])
def test_a_clear_edge_at_any_angle_gives_every_colour(tmp_path: Path, angle_rad: float) -> None:
    found = measure_edge(_edge(tmp_path, CLEAR, angle_rad=angle_rad), FOUR_UM, None)
    half = found.side_px // 2
    y, x = np.mgrid[-half : half + 1, -half : half + 1]
    for kernel, spread in zip(found.psf.kernels[0, 0], CLEAR.spreads_px[::-1], strict=True):
        truth = np.exp(-(y**2 + x**2) / (2 * spread**2))
        assert np.abs(kernel - truth / truth.sum()).max() < 0.03 * (truth / truth.sum()).max()
    assert found.fields[0].peak_share == pytest.approx(1, abs=1e-3)
    assert found.filled_samples == 0
    assert found.red is None


@pytest.mark.parametrize("core", [0.14, 0.6])
def test_the_light_near_the_peak_is_right_to_a_hundredth(tmp_path: Path, core: float) -> None:
    hazy = Hazy(core=core, seed=4)
    bracket = _edge(tmp_path, hazy)
    darks = Darks.read(hazy.write_darks(tmp_path), None, bracket)
    found = measure_edge(bracket, FOUR_UM, darks)
    assert found.fields[0].peak_share == pytest.approx(hazy.peak_share, abs=0.01)
    assert 0 < found.fields[0].peak_share_error < 0.005
    assert all(c.reblurred is not None and c.reblurred.rest < 0.005 for c in found.colours)
    kernel, half = found.psf.kernels[0, 0, 1], found.side_px // 2
    y, x = np.mgrid[-half : half + 1, -half : half + 1]
    assert kernel[np.hypot(y, x) <= 10].sum() == pytest.approx(hazy.peak_share, abs=0.01)


def test_haze_without_darks_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DecodeError, match=r"veiling glare fills the frame: \d+% .* by dark"):
        measure_edge(_edge(tmp_path, Hazy()), FOUR_UM, None)


def test_one_frame_and_its_darks_need_no_times(tmp_path: Path) -> None:
    hazy, path = Hazy(core=0.6, seed=4), tmp_path / "edge.dng"
    write_mosaic(path, exposed(mosaic_of(hazy.edge_planes(0.1)), 0.8, 1), 0.0)
    darks, timed = hazy.write_darks(tmp_path), survey([path], [1.0], alike=True)
    found = measure_edge(timed, FOUR_UM, Darks.read(darks, [1.0] * len(darks), timed))
    mute = survey([path], None, alike=True)
    assert (mute.is_timed, mute.frames[0].time_s) == (False, 1.0)
    # what the darks say of their time counts for nothing where the frame says nothing
    for times_s in (None, [30.0] * len(darks)):
        again = measure_edge(mute, FOUR_UM, Darks.read(darks, times_s, mute))
        assert again.fields == found.fields


def test_what_shows_no_edge_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "even.dng"
    write_mosaic(path, exposed(np.full((200, 200), 0.4), 1.0, 1), 1.0)
    with pytest.raises(DecodeError, match="no straight edge"):
        measure_edge(survey([path], None, alike=True), FOUR_UM, None)
    strip = np.zeros(999, dtype=np.intp)
    with pytest.raises(DecodeError, match="shows 7 px to one side of the edge"):
        Bins.of(np.linspace(-7, 90, 999), np.ones(999), np.ones(999), strip).profile()
    with pytest.raises(DecodeError, match="are clipped; expose less"):
        measure_edge(_edge(tmp_path, CLEAR, peak=1.2), FOUR_UM, None)


def test_a_side_may_be_asked_for_and_pitches_must_be_known(tmp_path: Path) -> None:
    bracket = _edge(tmp_path, CLEAR)
    found = measure_edge(bracket, PsfOptions(pixel_pitch_um=4.0, side_px=31), None)
    assert found.psf.kernels.shape == (1, 1, 3, 31, 31)
    for asked, told in ((PsfOptions(), "no pixel pitch"), (PsfOptions(pixel_pitch_um=4.0, side_px=2001), "at most 1023")):  # noqa: E501 # fmt: skip
        with pytest.raises(ContractError, match=told):
            measure_edge(bracket, asked, None)
