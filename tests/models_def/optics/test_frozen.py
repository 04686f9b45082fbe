import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from camkit.bundle.psf_file import read_psf, write_psf
from camkit.bundle.sensor import BayerSensor, ChannelResponse, Extent, IsoNoise
from camkit.errors import ContractError
from camkit.models_def.optics.freezable_optics import grid_layout, radial_layout
from camkit.models_def.optics.frozen import (
    FreezeGrid,
    corner_height_mm,
    dense_grid,
    freeze,
    freeze_at,
    freeze_stress,
    rounded,
    stress_depths_mm,
    with_focus,
)
from camkit.models_def.optics.kernel_bank import ChannelResponse as ChannelShares
from camkit.models_def.optics.kernel_bank import colour_kernels, gaussian_response
from camkit.models_def.optics.lens_optics import LensOptics
from camkit.models_def.optics.prescription import read_prescription
from camkit.runtime.bank.psf import color_kernels, wavelength_weights

DUET = Path(__file__).resolve().parents[3] / "models_def" / "prescriptions" / "duet.toml"
WAVES = np.linspace(0.42, 0.68, 14)
SMALL = FreezeGrid(fields=3, wavelengths=5, energy=0.99)


def duet(rays: int = 400) -> LensOptics:
    return LensOptics(lens=read_prescription(DUET), rays=rays)


@pytest.fixture(scope="module")
def sensor() -> BayerSensor:
    response = gaussian_response(WAVES).response
    return BayerSensor(
        extent=Extent(width_px=6000, height_px=4000, pixel_pitch_um=5.96),
        cfa="RGGB",
        black_level=256,
        white_level=4095,
        full_well_e=45000,
        noise=(IsoNoise(iso=100, gain_e_per_dn=11.72, read_noise_e=3.0),),
        channel_response=ChannelResponse(
            wavelengths_um=tuple(WAVES),
            response=tuple(tuple(row) for row in response),
            source="model",
        ),
        color_matrix=((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    )


def test_corner_is_half_the_diagonal(sensor: BayerSensor) -> None:
    assert corner_height_mm(sensor) == pytest.approx(21.489, abs=1e-3)


def test_frozen_psf_round_trips_through_its_file(sensor: BayerSensor, tmp_path: Path) -> None:
    frozen = freeze(duet(), sensor, SMALL)
    write_psf(tmp_path / "psf.safetensors", frozen.psf)
    back = read_psf(tmp_path / "psf.safetensors")
    assert np.array_equal(back.kernels, frozen.psf.kernels)
    assert np.array_equal(back.relative_illumination, frozen.psf.relative_illumination)
    assert back.field_heights_mm[-1] == corner_height_mm(sensor)
    assert frozen.energy_kept >= SMALL.energy


def test_kernel_side_is_the_smallest_that_holds_the_light(sensor: BayerSensor) -> None:
    sides = [
        freeze(duet(), sensor, replace(SMALL, energy=energy)).psf.kernels.shape[-1]
        for energy in (0.9, 0.99)
    ]
    assert sides[0] < sides[1] < SMALL.max_side_px
    assert all(side % 2 == 1 for side in sides)


def test_window_too_small_for_the_light_is_refused(sensor: BayerSensor) -> None:
    with pytest.raises(ContractError, match="hold"):
        freeze(duet(), sensor, replace(SMALL, max_side_px=61))


@pytest.mark.parametrize(
    "wrong",
    [
        {"fields": 1},
        {"wavelengths": 0},
        {"depths_mm": (9.0, 5.0)},
        {"depths_mm": (0.0,)},
        {"max_side_px": 64},
        {"energy": 1.5},
    ],
)
def test_impossible_grid_is_refused(wrong: dict) -> None:
    with pytest.raises(ContractError):
        FreezeGrid(**wrong)


def test_frozen_colours_equal_a_dense_trace(sensor: BayerSensor) -> None:
    """Five stored wavelengths give the camera's colours as 27 traced ones do."""
    heights = np.array([0.0, 12.0])
    fields = radial_layout(heights)
    psf = freeze_at(duet(), sensor, replace(SMALL, energy=0.9995), fields).psf
    found = color_kernels(psf, *sensor.response_arrays()).kernels
    waves = np.linspace(0.42, 0.68, 27)
    weights = wavelength_weights(waves, *sensor.response_arrays())
    dense = ChannelShares(wavelengths_um=waves, response=weights, source="camera")
    expected, _ = colour_kernels(
        duet().lens, dense, heights, size_px=psf.kernels.shape[-1], pitch_um=5.96, rays=400
    )
    apart = np.abs(found - expected).sum((-2, -1))
    assert apart.max() < 0.05


def test_kernels_are_rounded_to_what_a_picture_shows() -> None:
    kernels = np.random.default_rng(0).random((2, 3, 9, 9), dtype=np.float32) ** 8
    found = rounded(kernels)
    assert float((np.abs(found - kernels) / kernels).max()) <= 2.0**-13
    assert not (found.view(np.uint32) & 0x7FF).any()
    assert np.array_equal(rounded(found), found)
    assert not rounded(np.zeros((1, 1), np.float32)).any()


def test_one_wavelength_can_be_frozen(sensor: BayerSensor) -> None:
    psf = freeze(duet(), sensor, replace(SMALL, wavelengths=1, energy=0.9)).psf
    assert psf.wavelengths_um.tolist() == [0.54]


def test_dense_grid_doubles_fields_and_triples_wavelengths() -> None:
    dense = dense_grid(FreezeGrid(fields=13, wavelengths=7))
    assert (dense.fields, dense.wavelengths) == (25, 19)


def test_stress_kernels_spread_as_the_object_comes_near(sensor: BayerSensor) -> None:
    stress = freeze_stress(duet(300), sensor, SMALL).psf
    assert math.isinf(stress.depths_mm[-1])
    centre = torch.from_numpy(stress.kernels[0, :, 1])
    side = centre.shape[-1]
    away = torch.arange(side) - side // 2
    width = (centre.sum(-1) * away**2).sum(-1)
    assert float(width[0]) > 2 * float(width[-1])


def test_stress_distances_lie_around_those_of_the_design() -> None:
    assert stress_depths_mm((math.inf,)) == (5e3, 1e4, 2e4, 5e4, math.inf)
    of_one_metre = [round(1000 / depth, 9) for depth in stress_depths_mm((1000.0,))]
    assert of_one_metre == [1.2, 1.1, 1.05, 1.02, 1.0, 0.98, 0.95, 0.9, 0.8]
    of_two = stress_depths_mm((500.0, 10000.0))
    assert [round(1000 / depth, 9) for depth in of_two[:5]] == [2.2, 2.1, 2.05, 2.02, 2.0]
    assert [round(1000 / depth, 9) for depth in of_two[5:]] == [0.1, 0.08, 0.05, 0.0]


def test_between_depths_kernels_follow_one_over_distance_better_than_distance(
    sensor: BayerSensor,
) -> None:
    near_mm, far_mm = 2e4, 4e4
    for share in (0.25, 0.5, 0.75):
        there_mm = 1 / (share / near_mm + (1 - share) / far_mm)
        grid = replace(SMALL, depths_mm=(near_mm, there_mm, far_mm), energy=0.98)
        traced = freeze(duet(), sensor, grid).psf.kernels.astype(float)
        by_distance = (far_mm - there_mm) / (far_mm - near_mm)
        errors = [
            np.square(s * traced[:, 0] + (1 - s) * traced[:, 2] - traced[:, 1]).sum()
            for s in (share, by_distance)
        ]
        assert errors[0] < 0.8 * errors[1]
        signal = np.square(traced[:, 1]).sum()
        assert errors[0] < 0.1**2 * signal


def test_a_lens_gives_a_row_of_distortion_for_each_channel(sensor: BayerSensor) -> None:
    one, five = (duet().distortion(corner_height_mm(sensor), n).coefficients for n in (1, 5))
    assert one.shape == (1, 4)
    np.testing.assert_array_equal(five, np.tile(one, (5, 1)))


def test_a_lens_is_not_traced_off_the_y_axis() -> None:
    places = grid_layout(np.array([1.0]), np.array([0.0, 1.0]))
    with pytest.raises(ContractError, match="along \\+y"):
        duet().kernels(places, WAVES, depth_mm=math.inf, side_px=31, pitch_um=6.0)


def test_kernels_of_a_moved_sensor_join_those_that_stay(sensor: BayerSensor) -> None:
    """Those of the sensor where it is are the nominal ones, but for light that was cut off."""
    nominal = freeze(duet(), sensor, SMALL).psf
    psf, kept = with_focus(nominal, (-60.0, 1e-9, 60.0), duet().refocused, sensor)
    np.testing.assert_array_equal(psf.kernels, nominal.kernels)
    assert psf.focus_kernels is not None
    np.testing.assert_allclose(psf.focus_kernels[1], psf.kernels, atol=2e-4)
    assert 0.97 < kept <= 1
    response = sensor.response_arrays()
    traced = freeze(duet().refocused(30.0), sensor, SMALL).psf
    other = color_kernels(traced, *response).kernels
    side = min(other.shape[-1], psf.kernels.shape[-1])

    def cut(kernels: np.ndarray) -> np.ndarray:
        rim = (kernels.shape[-1] - side) // 2
        return kernels[..., rim : rim + side, rim : rim + side]

    away = [
        float(((cut(color_kernels(psf, *response, focus_um=f).kernels) - cut(other)) ** 2).sum())
        for f in (0.0, 30.0)
    ]
    assert away[1] < away[0] / 4, "half-way between two shifts the blend is near what is traced"


def test_the_reach_of_focus_covers_the_copies() -> None:
    reach_um = duet().focus_range_um()
    assert reach_um == duet().focus_range_um()
    assert (reach_um % 5, 60 <= reach_um <= 120) == (0, True)
