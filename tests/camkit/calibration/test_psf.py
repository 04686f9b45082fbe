"""A kernel that is known comes back from a bracket that clips, is noisy and has 12 bits."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.calibration.darks import Darks
from camkit.calibration.measured import MeasuredPsf, PsfOptions
from camkit.calibration.psf import measure_psf
from camkit.errors import ContractError, DecodeError
from camkit.psf import FrozenPsf
from camkit.runtime.merging.survey import Survey, survey
from tests.camkit.calibration.haze_factory import Hazy
from tests.camkit.calibration.point_factory import (
    STREAK,
    TIMES_S,
    Point,
    exposed,
    write_bracket,
    write_mosaic,
    write_pictures,
)

# of the peak: shot noise of the shortest frame there is 1.2 %
CORE_TOLERANCE = 0.03
STREAK_TOLERANCE = 0.06
SHORT_S = (1.0, 1 / 8, 1 / 64)
FIVE_UM = PsfOptions(pixel_pitch_um=5.0)
SMALL = Point(side=96, x=47.7, y=46.2, reach=20, streak=1e-3)


def _measured(psf: FrozenPsf) -> np.ndarray:
    return psf.kernels[0, 0].astype(np.float64)


def _check(found: MeasuredPsf, point: Point) -> None:
    kernels, half = _measured(found.psf), found.side_px // 2
    truth = point.kernels(half)
    dy, dx = np.mgrid[-half : half + 1, -half : half + 1]
    far = np.hypot(dy, dx) > 25
    for kernel, wanted in zip(kernels, truth, strict=True):
        peak = wanted.max()
        assert np.abs(kernel - wanted).max() < CORE_TOLERANCE * peak
        assert np.abs(kernel - wanted).sum() < 0.03
        assert np.sqrt(np.mean((kernel - wanted)[far] ** 2)) < 0.05 * STREAK * peak
        streak = far & (wanted > 0.5 * STREAK * peak)
        assert kernel[streak].sum() / wanted[streak].sum() == pytest.approx(1, abs=STREAK_TOLERANCE)


def test_a_mosaic_gives_the_kernel_with_streaks_of_1e_5_of_its_peak(tmp_path: Path) -> None:
    point = Point()
    found = measure_psf(survey(write_bracket(tmp_path, point), None), FIVE_UM, None)
    assert found.centre_px == pytest.approx((point.x, point.y), abs=0.02)
    assert 2 * point.reach <= found.side_px <= 2 * point.reach + 25
    assert found.notes == ()
    _check(found, point)
    assert [c.colour for c in found.colours] == ["blue", "green", "red"]
    dy, dx = np.mgrid[-98:99, -98:99]
    share = point.kernels(98)[2][np.hypot(dy, dx) <= 3].sum()
    assert found.colours[2].core_share == pytest.approx(share, abs=0.01)
    assert max(c.noise_floor for c in found.colours) < 1e-6


def test_linear_pictures_that_are_cut_at_black_give_it_too(tmp_path: Path) -> None:
    point = Point(x=128.5, y=130.02)
    found = measure_psf(survey(write_pictures(tmp_path, point), TIMES_S), FIVE_UM, None)
    assert found.centre_px == pytest.approx((point.x, point.y), abs=0.02)
    _check(found, point)


def test_dark_current_and_hot_pixels_are_taken_off(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    current = 0.05 * rng.random((96, 96)) ** 4
    current[30, 52], current[60, 41], current[10, 10] = 20.0, 3.0, 5000.0
    files = write_bracket(tmp_path, SMALL, dark=current, times_s=SHORT_S)
    dark = tmp_path / "dark.dng"
    write_mosaic(dark, exposed(current, SHORT_S[1], 50), SHORT_S[1])
    bracket, asked = survey(files, None), PsfOptions(pixel_pitch_um=5.0, side_px=41)
    errors = []
    for darks in (Darks.read([dark], None, bracket), None):
        found = measure_psf(bracket, asked, darks)
        off = np.abs(_measured(found.psf) - SMALL.kernels(20)).max(axis=0)
        off[14:27, 14:27] = 0
        errors.append(off.max() / SMALL.kernels(20).max())
    assert errors[0] < 2e-3
    assert errors[1] > 0.05


def test_a_hot_pixel_that_no_frame_sees_through_is_filled_and_counted(tmp_path: Path) -> None:
    current = np.zeros((96, 96))
    current[50, 61] = 1e5
    files = write_bracket(tmp_path, SMALL, dark=current, times_s=SHORT_S)
    path = tmp_path / "dark.dng"
    write_mosaic(path, exposed(current, SHORT_S[-1], 9), SHORT_S[-1])
    bracket = survey(files, None)
    asked = PsfOptions(pixel_pitch_um=5.0, side_px=41)
    found = measure_psf(bracket, asked, Darks.read([path], None, bracket))
    assert found.filled_samples == 1
    wrong = np.abs(_measured(found.psf) - SMALL.kernels(20)) / SMALL.kernels(20).max()
    assert wrong[:, 22:27, 31:36].max() < 5e-3


def _pictures(folder: Path, point: Point, peak: float = 0.7) -> Survey:
    files = write_pictures(folder, point, peak=peak, times_s=SHORT_S)
    return survey(files, SHORT_S)


def test_what_is_asked_for_is_what_is_written(tmp_path: Path) -> None:
    asked = PsfOptions(pixel_pitch_um=4.5, side_px=31, depth_m=2.0)
    found = measure_psf(_pictures(tmp_path, SMALL), asked, None)
    assert found.psf.kernels.shape == (1, 1, 3, 31, 31)
    assert found.psf.pixel_pitch_um == 4.5
    assert found.psf.depths_mm.tolist() == [2000]
    assert found.psf.symmetry == "uniform"
    assert found.psf.wavelengths_um.tolist() == [0.46, 0.54, 0.60]


def test_light_up_to_the_border_of_the_frame_is_said(tmp_path: Path) -> None:
    point = replace(SMALL, reach=90, streak=3e-2)
    found = measure_psf(_pictures(tmp_path, point), FIVE_UM, None)
    assert "light is still seen" in found.notes[0]


@pytest.mark.parametrize("spread_px", [0.5, 1.2])
def test_a_core_too_fine_for_a_mosaic_is_said(tmp_path: Path, spread_px: float) -> None:
    point = replace(SMALL, spreads_px=(spread_px,) * 3)
    files = write_bracket(tmp_path, point, times_s=SHORT_S)
    found = measure_psf(survey(files, None), FIVE_UM, None)
    assert any("too fine for the mosaic" in note for note in found.notes) == (spread_px < 1)
    planes = measure_psf(_pictures(tmp_path, point), FIVE_UM, None)
    assert planes.notes == ()


@pytest.mark.parametrize(
    ("point", "peak", "told"),
    [
        (SMALL, 1.4, r"clipped in the shortest frame, 2\.png"),
        (replace(SMALL, x=6.0), 0.7, "at the border of 96x96"),
        (SMALL, 1e-9, "no point light"),
    ],
)
def test_a_bracket_that_tells_no_psf_is_refused(
    tmp_path: Path, point: Point, peak: float, told: str
) -> None:
    with pytest.raises(DecodeError, match=told):
        measure_psf(_pictures(tmp_path, point, peak), FIVE_UM, None)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (PsfOptions(), "no pixel pitch"),
        (PsfOptions(pixel_pitch_um=5.0, side_px=95), "at most"),
    ],
)
def test_what_does_not_fit_the_frames_is_refused(
    tmp_path: Path, options: PsfOptions, told: str
) -> None:
    with pytest.raises(ContractError, match=told):
        measure_psf(_pictures(tmp_path, SMALL), options, None)


@pytest.mark.parametrize(
    "options", [{"side_px": 30}, {"side_px": 1}, {"pixel_pitch_um": -1.0}, {"depth_m": 0.0}]
)
def test_what_nobody_can_mean_is_refused(options: dict[str, float]) -> None:
    with pytest.raises(ContractError, match="must be"):
        PsfOptions(**options)  # type: ignore[arg-type]


def test_coded_pictures_are_refused(tmp_path: Path) -> None:
    files = [tmp_path / "a.png", tmp_path / "b.png"]
    for path in files:
        assert cv2.imwrite(str(path), np.full((40, 40, 3), 9, np.uint8))
    with pytest.raises(ContractError, match="linear frames"):
        measure_psf(survey(files, (1.0, 2.0)), FIVE_UM, None)


@pytest.mark.parametrize("core", [0.14, 0.6])
def test_the_light_near_the_peak_is_right_to_a_hundredth(tmp_path: Path, core: float) -> None:
    hazy = Hazy(core=core, seed=2)
    bracket = survey(hazy.write(tmp_path, hazy.planes()), None)
    darks = Darks.read(hazy.write_darks(tmp_path), None, bracket)
    found = measure_psf(bracket, PsfOptions(pixel_pitch_um=4.0), darks)
    (field,) = found.fields
    assert field.peak_share == pytest.approx(hazy.peak_share, abs=0.01)
    assert abs(field.peak_share - hazy.peak_share) < 3 * field.peak_share_error
    assert field.peak_share_error < 0.01
    off = np.hypot(hazy.x - 299.5, hazy.y - 299.5) * 0.004
    assert field.height_mm == pytest.approx(off, abs=2e-4)
    kernel, half = _measured(found.psf)[1], found.side_px // 2
    y, x = np.mgrid[-half : half + 1, -half : half + 1]
    assert kernel[np.hypot(y, x) <= 10].sum() == pytest.approx(hazy.peak_share, abs=0.01)


def test_a_wrong_black_is_in_the_error(tmp_path: Path) -> None:
    short, errors = (1 / 8, 1 / 64), []  # haze of some DN: half of one matters
    for drift_dn in (0.0, 0.5):
        hazy = Hazy(side=360, end=140, scale=60, x=181.3, y=178.6, drift_dn=drift_dn)
        bracket = survey(hazy.write(tmp_path, hazy.planes(), times_s=short), None)
        darks = Darks.read(hazy.write_darks(tmp_path, 8, short[0]), None, bracket)
        (field,) = measure_psf(bracket, PsfOptions(pixel_pitch_um=4.0), darks).fields
        assert abs(field.peak_share - hazy.peak_share) < 3 * field.peak_share_error
        errors.append(field.peak_share_error)
    # what noise alone explains is less than black moved it by
    assert abs(field.peak_share - hazy.peak_share) > 3 * errors[0]
    assert errors[1] > 4 * errors[0]


def test_haze_without_darks_is_refused(tmp_path: Path) -> None:
    hazy = Hazy(side=360, x=181.3, y=178.6)
    bracket = survey(hazy.write(tmp_path, hazy.planes()), None)
    with pytest.raises(DecodeError, match=r"veiling glare fills the frame: \d+% .* by dark"):
        measure_psf(bracket, PsfOptions(pixel_pitch_um=4.0), None)
