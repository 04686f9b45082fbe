"""A plate goes through freezing as any optics do, and gives its kernels as arrays."""

import math
from pathlib import Path

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.geometry import Bench
from camkit.models_def.optics.diffraction.gratings import Streaks, chirped_gratings
from camkit.models_def.optics.diffraction.plate import Plate, write_plate
from camkit.models_def.optics.diffraction.plate_optics import PlateOptics, plate_kernels
from camkit.models_def.optics.diffraction.wave import PixelGrid
from camkit.models_def.optics.freezable_optics import Optics, radial_layout
from camkit.models_def.optics.lens_optics import LensOptics
from camkit.models_def.optics.optics_file import read_optics

PITCH_UM = 6.0
BENCH = Bench(diameter_mm=2.0, focal_length_mm=20.0, focus_mm=2000.0)
HORIZONTAL = Streaks(
    angles_rad=(0.0,), near_um=30.0, far_um=120.0, share=0.2, wavelength_um=0.55, index=1.46
)
FLOAT32 = 1e-6


@pytest.fixture
def plate() -> Plate:
    height_um = chirped_gratings(HORIZONTAL, BENCH, cells=96)().detach().float()
    return Plate(name="line", glass="SILICA", bench=BENCH, height_um=height_um)


def test_kernels_are_the_psf_of_every_depth_and_wavelength_not_normalised(plate: Plate) -> None:
    waves, depths_m = (0.5, 0.6), (2.0, math.inf)
    found = plate_kernels(
        plate, depths_m=depths_m, wavelengths_um=waves, side_px=41, pitch_um=PITCH_UM
    )
    assert found.shape == (2, 2, 41, 41)
    assert found.dtype == np.float32
    grid = PixelGrid(side_px=41, pitch_um=PITCH_UM)
    for i, depth_m in enumerate(depths_m):
        for j, wave in enumerate(waves):
            alone = plate.psf(wave, grid, 1000 * depth_m).numpy()
            np.testing.assert_allclose(found[i, j], alone, atol=FLOAT32)
    wider = plate_kernels(
        plate, depths_m=(2.0,), wavelengths_um=waves, side_px=61, pitch_um=PITCH_UM
    )
    np.testing.assert_allclose(wider[0, :, 10:-10, 10:-10], found[0], atol=FLOAT32)
    sums = found.sum((-2, -1))
    assert (sums > 0.9).all()
    assert (sums < 1).all()
    assert (wider.sum((-2, -1)) > sums[0]).all()


def test_the_bare_lens_is_the_same_bench_with_a_flat_plate(plate: Plate) -> None:
    flat = Plate(
        name="flat", glass="SILICA", bench=BENCH, height_um=torch.zeros_like(plate.height_um)
    )
    bare, dirac, with_plate = (
        plate_kernels(
            one, depths_m=(2.0,), wavelengths_um=(0.55,), side_px=41, pitch_um=PITCH_UM, bare=bare
        )[0, 0]
        for one, bare in ((plate, True), (flat, False), (plate, False))
    )
    np.testing.assert_allclose(bare, dirac, atol=FLOAT32)
    arm = np.s_[20, 26:]
    assert with_plate[arm].sum() > 20 * bare[arm].sum()


def test_a_plate_fulfils_optics(plate: Plate) -> None:
    optics: Optics = PlateOptics(plate=plate)
    layout = optics.layout(5.0, 25)
    assert layout.symmetry == "uniform"
    assert layout.count == 1
    waves_um = np.array([0.5, 0.6])
    traced = optics.kernels(layout, waves_um, depth_mm=2000.0, side_px=41, pitch_um=PITCH_UM)
    light = plate_kernels(
        plate, depths_m=(2.0,), wavelengths_um=(0.5, 0.6), side_px=41, pitch_um=PITCH_UM
    )
    torch.testing.assert_close(traced.kernels.sum((-2, -1)), torch.ones(1, 2, dtype=torch.float64))
    held = traced.kernels * traced.energy_kept[..., None, None]
    np.testing.assert_allclose(held[0].numpy(), light[0], atol=FLOAT32)
    assert (optics.name, optics.depths_mm, optics.focus_mm) == ("line", (2000.0,), 2000.0)
    assert optics.facts == {"efl_mm": 20.0, "diameter_mm": 2.0}
    assert optics.wavelengths_um is None
    assert optics.reference_wavelength_um == 0.55
    assert optics.distortion(5.0, 3).coefficients.tolist() == [[1.0, 0, 0, 0]] * 3
    assert optics.illumination(layout).tolist() == [1.0]
    assert optics.copies(3, 1) == (optics,)


def test_a_plate_without_a_lens_has_no_focal_length() -> None:
    plate = Plate(
        name="alone",
        glass="SILICA",
        bench=Bench(diameter_mm=1.0, sensor_mm=50.0),
        height_um=torch.zeros(64, 64),
    )
    assert PlateOptics(plate=plate).facts == {"diameter_mm": 1.0}


def test_a_plate_gives_no_kernels_of_several_places(plate: Plate) -> None:
    with pytest.raises(ContractError, match="ask for one place"):
        PlateOptics(plate=plate).kernels(
            radial_layout(np.array([0.0, 1.0])),
            np.array([0.55]),
            depth_mm=2000.0,
            side_px=21,
            pitch_um=PITCH_UM,
        )


def test_toml_with_a_bench_is_a_plate_and_without_one_a_lens(plate: Plate, tmp_path: Path) -> None:
    write_plate(plate, tmp_path / "line.toml")
    found = read_optics(tmp_path / "line.toml")
    assert isinstance(found, PlateOptics)
    assert torch.equal(found.plate.height_um, plate.height_um)
    assert isinstance(read_optics(Path("duet")), LensOptics)
