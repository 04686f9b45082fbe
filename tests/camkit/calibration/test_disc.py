"""A disc is taken out of its own picture, or is refused."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy import fft, special

from camkit.calibration.darks import Darks
from camkit.calibration.disc import blurred_disc, disc_spectrum, middle_of
from camkit.calibration.measured import MeasuredPsf, PsfOptions
from camkit.calibration.psf import measure_psf
from camkit.errors import ContractError, DecodeError
from camkit.runtime.merging.survey import survey
from tests.camkit.calibration.haze_factory import Hazy
from tests.camkit.calibration.point_factory import TIMES_S, FloatGrid, Point, write_planes

SHARE_TOLERANCE = 0.01
PLAIN = Point(side=200, x=101.3, y=98.6, reach=60)


@dataclass(frozen=True, slots=True, kw_only=True)
class Comatic(Point):
    """Its core has a tail to one side, and blue lies off."""

    def kernel(self, colour: int, dy: FloatGrid, dx: FloatGrid) -> FloatGrid:
        spread, off = self.spreads_px[colour], 0.4 * (colour == 2)

        def bell(y: float, x: float, wide: float) -> FloatGrid:
            return np.asarray(np.exp(-0.5 * ((dy - y) ** 2 + (dx - x - off) ** 2) / wide**2))

        tail = 0.25 * bell(1.5, 2.5, 1.6 * spread) + 0.08 * bell(3, 5, 2.2 * spread)
        return bell(0, 0, spread) + tail + 1e-3 * bell(0, 0, 6)


def _discs(planes: FloatGrid, diameter_px: float, edge: int = 16) -> FloatGrid:
    wide = np.pad(planes, ((0, 0), (edge, edge), (edge, edge)), mode="edge")
    n = wide.shape[-1]
    disc = disc_spectrum(np.hypot(fft.fftfreq(n)[:, None], fft.rfftfreq(n)[None]), diameter_px)
    found = fft.irfft2(fft.rfft2(wide) * disc, s=(n, n))[:, edge:-edge, edge:-edge]
    return np.asarray(found / found.max())


def _measured(folder: Path, point: Point, diameter_px: float, said_px: float | None = None) -> MeasuredPsf:  # noqa: E501 # fmt: skip
    files = write_planes(folder, _discs(point.planes(), diameter_px))
    asked = PsfOptions(pixel_pitch_um=4.0, disc_px=said_px or diameter_px)
    return measure_psf(survey(files, TIMES_S), asked, None)


def _errors(found: MeasuredPsf, point: Point) -> tuple[FloatGrid, FloatGrid]:
    """Give of each colour the sum of errors, and the largest in parts of the peak."""
    half = found.side_px // 2
    y, x = np.mgrid[-half : half + 1, -half : half + 1].astype(np.float64)
    x, y = x + found.centre_px[0] - point.x, y + found.centre_px[1] - point.y
    truth = np.stack([point.kernel(c, y, x) for c in (2, 1, 0)])
    truth /= truth.sum((-2, -1), keepdims=True)
    off = np.abs(found.psf.kernels[0, 0] - truth)
    return off.sum((-2, -1)), off.max((-2, -1)) / truth.max((-2, -1))


def test_the_spectrum_of_a_disc_is_one_and_then_none_at_its_first_ring() -> None:
    found = disc_spectrum(np.array([0.0, special.jn_zeros(1, 1)[0] / np.pi / 6]), 6.0)
    assert found == pytest.approx([1, 0], abs=1e-12)


@pytest.mark.parametrize(("diameter_px", "spread_px"), [(5.0, 1.3), (1.0, 2.0), (20.0, 0.8)])
def test_a_blurred_disc_has_its_closed_forms(diameter_px: float, spread_px: float) -> None:
    radius = np.arange(0, diameter_px / 2 + 8 * spread_px, 0.01)
    found = blurred_disc(radius, diameter_px, spread_px)
    assert found[0] == pytest.approx(1 - np.exp(-((diameter_px / spread_px) ** 2) / 8), rel=1e-6)
    light = 2 * np.pi * np.trapezoid(found * radius, radius)
    assert light == pytest.approx(np.pi * diameter_px**2 / 4, rel=1e-4)


def test_the_middle_is_found_from_any_place_on_a_disc() -> None:
    y, x = np.indices((60, 80))
    cells = 1.0 * (np.hypot(y - 30, x - 41) < 6)
    assert {middle_of(cells, place, 6.0) for place in ((30, 41), (26, 38), (35, 42))} == {(30, 41)}


@pytest.mark.parametrize("diameter_px", [2.5, 4.0, 8.0])
def test_the_psf_comes_out_of_a_disc(tmp_path: Path, diameter_px: float) -> None:
    found = _measured(tmp_path, PLAIN, diameter_px)
    assert found.centre_px == pytest.approx((PLAIN.x, PLAIN.y), abs=0.03)
    total, worst = _errors(found, PLAIN)
    assert total.max() < 0.07
    assert worst.max() < 0.04
    assert (found.psf.kernels >= 0).all()
    assert found.psf.kernels.sum((-2, -1)) == pytest.approx(1, abs=1e-5)
    assert all(c.reblurred is not None and c.reblurred.rest < 0.005 for c in found.colours)


def test_a_core_that_is_no_gaussian_keeps_its_tail_and_its_lateral_colour(tmp_path: Path) -> None:
    point = Comatic(side=200, x=101.3, y=98.6, reach=60)
    found = _measured(tmp_path, point, 4.0)
    total, worst = _errors(found, point)
    assert total.max() < 0.12
    assert worst.max() < 0.13
    assert found.colours[0].offset_px == pytest.approx((0.4, 0), abs=0.05)


def test_a_disc_taken_for_a_point_is_told_by_the_peak(tmp_path: Path) -> None:
    files = write_planes(tmp_path, _discs(PLAIN.planes(), 6.0))
    as_point = measure_psf(survey(files, TIMES_S), PsfOptions(pixel_pitch_um=4.0), None)
    assert _errors(as_point, PLAIN)[1].min() > 0.3


def test_a_disc_that_hides_the_core_is_refused(tmp_path: Path) -> None:
    sharp = Point(side=200, x=101.3, y=98.6, reach=60, spreads_px=(0.8, 0.8, 0.8))
    with pytest.raises(DecodeError, match=r"a disc of 9 px is too large .* hides [\d.]+% of"):
        _measured(tmp_path, sharp, 9.0)


def test_a_disc_under_much_noise_is_refused(tmp_path: Path) -> None:
    files = write_planes(tmp_path, _discs(PLAIN.planes(), 6.0), peak=0.003)
    asked = PsfOptions(pixel_pitch_um=4.0, disc_px=6.0)
    with pytest.raises(DecodeError, match="more light"):
        measure_psf(survey(files, TIMES_S), asked, None)


@pytest.mark.parametrize("diameter_px", [0.0, -1.0, np.inf])
def test_a_disc_must_have_a_diameter(diameter_px: float) -> None:
    with pytest.raises(ContractError, match="disc_px must be > 0"):
        PsfOptions(disc_px=diameter_px)


@pytest.mark.parametrize("core", [0.14, 0.6])
def test_the_light_near_the_peak_is_right_to_a_hundredth(tmp_path: Path, core: float) -> None:
    hazy = Hazy(core=core, seed=3)
    bracket = survey(hazy.write(tmp_path, hazy.planes(5.0)), None)
    darks = Darks.read(hazy.write_darks(tmp_path), None, bracket)
    found = measure_psf(bracket, PsfOptions(pixel_pitch_um=4.0, disc_px=5.0), darks)
    (field,) = found.fields
    assert field.peak_share == pytest.approx(hazy.peak_share, abs=SHARE_TOLERANCE)
    assert abs(field.peak_share - hazy.peak_share) < 4 * field.peak_share_error
    kernel, half = found.psf.kernels[0, 0, 1], found.side_px // 2
    y, x = np.mgrid[-half : half + 1, -half : half + 1]
    assert kernel[np.hypot(y, x) <= 10].sum() == pytest.approx(hazy.peak_share, abs=SHARE_TOLERANCE)
