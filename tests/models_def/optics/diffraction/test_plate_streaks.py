"""The streaks of a plate are those of its own kernels, behind the colours of a sensor."""

import math

import numpy as np
import pytest
import torch

from camkit.bundle.sensor import ChannelResponse
from camkit.models_def.optics.diffraction.geometry import Bench
from camkit.models_def.optics.diffraction.gratings import Streaks, chirped_gratings
from camkit.models_def.optics.diffraction.plate import Plate
from camkit.models_def.optics.diffraction.plate_optics import plate_kernels
from camkit.models_def.optics.diffraction.plate_streaks import WAVELENGTHS, plate_streaks
from camkit.models_def.optics.diffraction.streak_fit import NoStreaksError
from tests.camera_factory import make_sensor

BENCH = Bench(diameter_mm=2.0, focal_length_mm=20.0, focus_mm=2000.0)
CROSS = Streaks(
    angles_rad=(0.3, 0.3 + math.pi / 2), near_um=30.0, far_um=120.0, share=0.1,
    wavelength_um=0.55, index=1.46,
)  # fmt: skip
SIDE_PX = 81
SENSOR = make_sensor(
    pixel_pitch_um=6.0,
    channel_response=ChannelResponse(
        wavelengths_um=(0.5, 0.6), response=((0, 1), (1, 1), (1, 0)), source="made up"
    ),
)


@pytest.fixture(scope="module")
def plate() -> Plate:
    height_um = chirped_gratings(CROSS, BENCH, cells=128)().detach().float()
    return Plate(name="cross", glass="SILICA", bench=BENCH, height_um=height_um)


def test_the_parts_are_those_of_the_plates_kernels(plate: Plate) -> None:
    waves_um = np.array([0.5, 0.6])
    found = plate_streaks(
        plate, SENSOR, depths_mm=(1000.0, 2000.0), wavelengths_um=waves_um, side_px=SIDE_PX
    )
    assert found.depths_mm.tolist() == [1000.0, 2000.0]
    assert found.wavelengths_um.tolist() == [0.5, 0.6]
    assert found.pixel_pitch_um == 6.0
    angles = np.degrees(found.angles_rad) % 90
    np.testing.assert_allclose(angles, math.degrees(0.3), atol=0.5)
    true, bare = (
        plate_kernels(
            plate, depths_m=(1.0, 2.0), wavelengths_um=(0.5, 0.6), side_px=SIDE_PX, pitch_um=6.0,
            bare=flat,
        )
        for flat in (False, True)
    )  # fmt: skip
    dense = found.dense()
    beside = (SIDE_PX - dense.shape[-1]) // 2
    assert beside >= 0
    padded = np.pad(dense, ((0, 0), (0, 0), (beside, beside), (beside, beside)))
    assert np.abs(padded - true).sum((-2, -1)).max() / 2 < 0.02
    middle = np.s_[..., SIDE_PX // 2 - 3 : SIDE_PX // 2 + 4, SIDE_PX // 2 - 3 : SIDE_PX // 2 + 4]
    np.testing.assert_allclose(found.dense(bare=True).sum((-2, -1)), bare.sum((-2, -1)), atol=0.02)
    assert bare[middle].sum() > true[middle].sum()


def test_without_depths_and_wavelengths_the_focus_and_the_response_are_taken(
    plate: Plate,
) -> None:
    found = plate_streaks(plate, SENSOR, side_px=SIDE_PX)
    assert found.depths_mm.tolist() == [BENCH.focus_mm]
    np.testing.assert_allclose(found.wavelengths_um, np.linspace(0.5, 0.6, WAVELENGTHS))


def test_a_plate_without_relief_writes_no_streaks(plate: Plate) -> None:
    flat = Plate(
        name="flat", glass="SILICA", bench=BENCH, height_um=torch.zeros_like(plate.height_um)
    )
    with pytest.raises(NoStreaksError):
        plate_streaks(flat, SENSOR, wavelengths_um=np.array([0.55]), side_px=SIDE_PX)
