"""A measured PSF goes through freezing as it is: where it was measured, and never mirrored."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.signal
import torch

from camkit.bundle.psf_file import write_psf
from camkit.bundle.sensor import ChannelResponse, Extent, IsoNoise, PlanesSensor
from camkit.bundle.stages import Wiener
from camkit.calibration.psf_import.kernel_resampling import resampled_kernels
from camkit.errors import ContractError
from camkit.models_def.optics import freeze as freeze_module
from camkit.models_def.optics import sampling_loss
from camkit.models_def.optics.freezable_optics import Optics, radial_layout
from camkit.models_def.optics.freeze import freeze_samples
from camkit.models_def.optics.frozen import FreezeGrid, freeze, freeze_stress
from camkit.models_def.optics.lens_optics import LensOptics
from camkit.models_def.optics.measured import (
    MeasuredOptics,
    measured_psf,
    read_measured,
)
from camkit.models_def.optics.optics_file import read_optics
from camkit.models_def.sensors.forward import blur
from camkit.psf import FrozenPsf
from camkit.runtime.bank.psf import color_kernels
from tests.psf_factory import coma_kernels, frozen_psf, streak_kernel

DUET = Path(__file__).resolve().parents[3] / "models_def" / "prescriptions" / "duet.toml"
PITCH_UM = 4.0
ROUNDING = 2.0**-12
FFT_ERROR = 2e-6
GRID = FreezeGrid(energy=0.999, max_side_px=61)
WAVES = (0.5, 0.6)
X_MM, Y_MM = np.array([-0.6, 0.0, 0.6]), np.array([-0.4, 0.4])
TURNS = np.arange(6).reshape(2, 3) * 60.0
STREAKS = np.stack([[streak_kernel(turn) for turn in row] for row in TURNS])


@pytest.fixture
def sensor() -> PlanesSensor:
    return PlanesSensor(
        extent=Extent(width_px=400, height_px=300, pixel_pitch_um=PITCH_UM),
        channels=("Y",),
        black_level=64,
        white_level=4095,
        full_well_e=9000,
        noise=(IsoNoise(iso=100, gain_e_per_dn=2.2, read_noise_e=2.0),),
        channel_response=ChannelResponse(
            wavelengths_um=(0.45, 0.55, 0.65), response=((0.5, 1.0, 0.5),), source="made up"
        ),
    )


def uniform(turn_deg: float) -> MeasuredOptics:
    kernels = np.stack([streak_kernel(turn_deg)] * 2)
    psf = measured_psf(3 * kernels, pixel_pitch_um=PITCH_UM, wavelengths_um=WAVES)
    return MeasuredOptics(psf=psf, name="streak")


def grid() -> MeasuredOptics:
    kernels = np.stack([STREAKS, STREAKS], axis=2)
    psf = measured_psf(kernels, pixel_pitch_um=PITCH_UM, wavelengths_um=WAVES, grid_mm=(X_MM, Y_MM))
    return MeasuredOptics(psf=psf, name="streaks")


def middle(kernel: np.ndarray, side: int) -> np.ndarray:
    cut = (kernel.shape[-1] - side) // 2
    inner = kernel[cut : cut + side, cut : cut + side]
    return inner / inner.sum()


@pytest.mark.parametrize("turn_deg", [0.0, 90.0, 200.0])
def test_one_sided_streak_keeps_its_side_through_freezing(
    turn_deg: float, sensor: PlanesSensor
) -> None:
    frozen = freeze(uniform(turn_deg), sensor, GRID)
    assert frozen.psf.symmetry == "uniform"
    assert frozen.energy_kept >= 0.999
    assert frozen.psf.wavelengths_um.tolist() == list(WAVES)
    assert frozen.psf.distortion.coefficients.shape == (1, 4)
    for wave in range(2):
        found = frozen.psf.kernels[0, 0, wave]
        expected = middle(streak_kernel(turn_deg), found.shape[-1])
        np.testing.assert_allclose(found, expected, rtol=ROUNDING, atol=1e-7)


def test_streaks_of_a_grid_fall_where_direct_convolution_puts_them(sensor: PlanesSensor) -> None:
    psf = freeze(grid(), sensor, GRID).psf
    assert psf.symmetry == "grid"
    scene = np.random.default_rng(0).random((60, 70)).astype(np.float32)
    fields = color_kernels(psf, *sensor.response_arrays())
    for row, y_mm in enumerate(Y_MM):
        for column, x_mm in enumerate(X_MM):
            kernels = torch.from_numpy(fields.at(x_mm, y_mm))[None]
            found = blur(torch.from_numpy(scene)[None, None], kernels)[0, 0].numpy()
            streak = middle(STREAKS[row, column], kernels.shape[-1])
            expected = scipy.signal.convolve2d(scene, streak, "valid")
            np.testing.assert_allclose(found, expected, atol=FFT_ERROR + ROUNDING)


def test_a_file_is_frozen_with_its_losses(
    sensor: PlanesSensor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sampling_loss, "PATCH_PX", 192)
    monkeypatch.setattr(sampling_loss, "PLACES", 3)
    monkeypatch.setattr(freeze_module, "BLOCKS", ((256, 64),))
    write_psf(tmp_path / "streaks.safetensors", grid().psf)
    optics = read_optics(tmp_path / "streaks.safetensors")
    assert optics.name == "streaks"
    settings = Wiener(prior_scale=3e-4, prior_exponent=2.5, block_px=256, overlap_px=64)
    said: list[str] = []
    frozen, told = freeze_samples(
        optics,
        sensor=sensor,
        settings=settings,
        grid=GRID,
        tell=said.append,
    )
    assert [line.split(":")[0] for line in said[1:3]] == ["2 wavelengths, 6 fields"] * 2
    assert (told["fields"], told["wavelengths"]) == (6, 2)
    assert told["loss_db"] <= 0.05
    assert "efl_mm" not in told
    assert frozen.psf.grid_x_mm.tolist() == X_MM.tolist()


def test_a_lens_and_a_measurement_are_told_apart_by_the_suffix(tmp_path: Path) -> None:
    assert isinstance(read_optics(DUET), LensOptics)
    write_psf(tmp_path / "seen.safetensors", uniform(0).psf)
    both: tuple[Optics, Optics] = (read_optics(DUET), read_measured(tmp_path / "seen.safetensors"))
    assert [len(optics.copies(3, 1)) for optics in both] == [3, 1]
    assert [optics.wavelengths_um is None for optics in both] == [True, False]


def test_off_its_depths_a_measurement_is_not_known(sensor: PlanesSensor) -> None:
    with pytest.raises(ContractError, match="the one depth infinity"):
        freeze_stress(uniform(0), sensor, GRID)
    with pytest.raises(ContractError, match="the one depth infinity; got 2 m"):
        freeze(uniform(0), sensor, FreezeGrid(depths_mm=(2000.0,), max_side_px=61))


def test_between_depths_and_wavelengths_kernels_are_blended(sensor: PlanesSensor) -> None:
    one, two = streak_kernel(0), streak_kernel(180)
    psf = uniform(0).psf
    fields = {name: getattr(psf, name) for name in FrozenPsf.__dataclass_fields__}
    fields |= {
        "kernels": np.stack([[one, two], [two, one]])[None],
        "depths_mm": np.array([1000.0, np.inf]),
    }
    optics = MeasuredOptics(psf=FrozenPsf(**fields), name="two")
    assert (optics.depths_mm, optics.focus_mm) == ((1000.0, np.inf), np.inf)
    seen = optics.kernels(
        optics.layout(1.0, 5),
        np.array([0.4, 0.5, 0.525]),
        depth_mm=4000.0,
        side_px=25,
        pitch_um=PITCH_UM,
    )
    near = 0.25  # a quarter of the way from infinity in 1 / distance
    at_blue = near * one + (1 - near) * two
    at_red = near * two + (1 - near) * one
    for found, share in zip(seen.kernels[0].numpy(), (0.0, 0.0, 0.25), strict=True):
        expected = (1 - share) * at_blue + share * at_red
        np.testing.assert_allclose(found[2:-2, 2:-2], expected, atol=1e-7)
    np.testing.assert_allclose(seen.energy_kept, 1)


def test_even_powers_of_distortion_come_along_for_every_channel() -> None:
    known = uniform(0.0)
    bent = replace(known.psf.distortion, even_coefficients=np.array([[0.01, -0.002, 0.0]]))
    optics = replace(known, psf=replace(known.psf, distortion=bent))
    distortion = optics.distortion(1.0, 3)
    for channel in range(3):
        np.testing.assert_array_equal(distortion.row(channel)[4:], [0.01, -0.002, 0.0])


def test_light_outside_the_window_is_told() -> None:
    seen = uniform(0).kernels(
        uniform(0).layout(1.0, 1), np.array(WAVES), depth_mm=np.inf, side_px=5, pitch_um=PITCH_UM
    )
    assert float(seen.kernels.sum()) == pytest.approx(2)
    inside = streak_kernel(0)[8:13, 8:13].sum()
    np.testing.assert_allclose(seen.energy_kept, inside, rtol=1e-5)


@pytest.mark.parametrize("ratio", [0.5, 0.7, 1.0, 1.6, 3.0])
def test_another_pitch_loses_no_light_and_keeps_its_place_within_a_sample(ratio: float) -> None:
    """Light is shared by area, so that its centre may move by a fraction of a sample."""
    kernel = torch.from_numpy(streak_kernel(40)).double()
    found = torch.from_numpy(resampled_kernels(kernel.numpy(), ratio))
    assert found.shape[-1] % 2 == 1
    assert float(found.sum()) == pytest.approx(1, abs=1e-6)
    for axis in (0, 1):
        old, new = (
            float(((torch.arange(k.shape[axis]) - k.shape[axis] // 2) * k.sum(1 - axis)).sum())
            for k in (kernel, found)
        )
        assert new == pytest.approx(ratio * old, abs=0.05)


def test_a_radial_measurement_is_a_lens_that_nobody_can_trace(sensor: PlanesSensor) -> None:
    kernels, heights = coma_kernels(tail_px=3.0)
    optics = MeasuredOptics(psf=frozen_psf(kernels, heights, [0.45, 0.55, 0.65]), name="coma")
    assert optics.layout(1.0, 3).symmetry == "radial"
    with pytest.raises(ContractError, match="3 channels, the sensor 1"):
        freeze(optics, sensor, GRID)
    assert optics.illumination(radial_layout(np.array([0.0, 0.3]))).tolist() == [1, 1]


def test_light_falls_off_between_the_places_of_a_grid() -> None:
    optics = grid()
    psf = optics.psf
    fields = {name: getattr(psf, name) for name in FrozenPsf.__dataclass_fields__}
    light = np.array([0.5, 1.0, 0.5, 0.7, 1.0, 0.7])
    dim = MeasuredOptics(psf=FrozenPsf(**(fields | {"relative_illumination": light})), name="dim")
    np.testing.assert_allclose(dim.illumination(dim.layout(1.0, 1)), light)


@pytest.mark.parametrize(
    ("kernels", "message"),
    [
        (np.ones((3, 3)), "wavelength, h, w"),
        (np.ones((1, 2, 1, 3, 3)), "wavelength, h, w"),
        (np.zeros((1, 3, 3)), "needs light"),
        (np.ones((1, 4, 4)), "odd"),
        (np.stack([np.diag([3.0, -1, 1])]), "negative"),
    ],
)
def test_arrays_that_are_no_psf_are_refused(kernels: np.ndarray, message: str) -> None:
    with pytest.raises(ContractError, match=message):
        measured_psf(kernels, pixel_pitch_um=4.0, wavelengths_um=(0.5,))
