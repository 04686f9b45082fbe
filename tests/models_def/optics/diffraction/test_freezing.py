"""A plate is frozen whole: its window and its colours lose no more light than is stated."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from typer.testing import CliRunner

from camkit.bundle.psf_file import read_psf
from camkit.bundle.sensor import PlanesSensor
from camkit.cli.app import app
from camkit.errors import ContractError
from camkit.models_def.optics.diffraction import freezing
from camkit.models_def.optics.diffraction.freezing import (
    MISPLACED_LIMIT,
    STREAKS_LIMIT,
    WINDOW,
    freeze_plate,
)
from camkit.models_def.optics.diffraction.geometry import Bench
from camkit.models_def.optics.diffraction.gratings import Streaks, chirped_gratings
from camkit.models_def.optics.diffraction.patterns import FlatPattern, Pattern, PeakPattern
from camkit.models_def.optics.diffraction.plate import Plate, pattern_plate, write_plate
from camkit.models_def.optics.diffraction.plate_optics import PlateOptics, plate_kernels
from camkit.runtime.bank.psf import wavelength_weights
from tests.two_colours import red_and_blue_sensor

BENCH = Bench(diameter_mm=2.0, focal_length_mm=20.0, focus_mm=2000.0)
STREAKS = Streaks(
    angles_rad=(0.0, math.pi / 2), near_um=30.0, far_um=120.0, share=0.1,
    wavelength_um=0.55, index=1.46,
)  # fmt: skip
PEAK = PeakPattern(right_um=72.0, down_um=60.0, share=0.2)
SMALL = replace(WINDOW, max_side_px=61)


@pytest.fixture(scope="module")
def optics() -> PlateOptics:
    height_um = chirped_gratings(STREAKS, BENCH, cells=128)().detach().float()
    return PlateOptics(plate=Plate(name="cross", glass="SILICA", bench=BENCH, height_um=height_um))


@pytest.fixture(scope="module")
def sensor() -> PlanesSensor:
    return red_and_blue_sensor()


def _off(
    optics: PlateOptics,
    sensor: PlanesSensor,
    kernels: NDArray[np.float32],
    wavelengths_um: NDArray[np.float64],
) -> float:
    """Give the share of a colour's light that kernels of 2 m have elsewhere than the plate."""
    response_um, response = sensor.response_arrays()
    many_um = np.linspace(0.45, 0.65, 81)
    light = plate_kernels(
        optics.plate,
        depths_m=(2.0,),
        wavelengths_um=tuple(many_um),
        side_px=kernels.shape[-1],
        pitch_um=6.0,
    )[0]
    true = np.einsum("cw,wyx->cyx", wavelength_weights(many_um, response_um, response), light)
    few = wavelength_weights(wavelengths_um, response_um, response)
    found = np.einsum("cw,wyx->cyx", few, kernels)
    found, true = (one / one.sum((-2, -1), keepdims=True) for one in (found, true))
    return float(np.abs(found - true).sum((-2, -1)).max()) / 2


@pytest.mark.parametrize("pattern", [PEAK, FlatPattern()], ids=["peak", "flat"])
def test_what_writes_no_streaks_is_frozen_as_kernels_of_the_right_colours(
    pattern: Pattern, sensor: PlanesSensor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # a peak so near is nearly an arm
    monkeypatch.setattr(freezing, "STREAKS_LIMIT", 1e-4)
    plate = pattern_plate("no-streaks", pattern, cells=128, bench=BENCH)
    lines: list[str] = []
    grid = replace(SMALL, depths_mm=(1000.0, 2000.0))
    optics = PlateOptics(plate=plate)
    frozen, told = freeze_plate(optics, sensor=sensor, grid=grid, tell=lines.append)
    psf = frozen.psf
    assert frozen.streaks is None
    assert psf.symmetry == "uniform"
    assert psf.depths_mm.tolist() == [1000.0, 2000.0]
    assert told["form"] == "kernels"
    assert "frozen as kernels" in "".join(lines)
    assert told["wavelengths"] == psf.wavelengths_um.size
    off = _off(optics, sensor, psf.kernels[0, 1], psf.wavelengths_um)
    assert off <= 1.2 * MISPLACED_LIMIT
    assert told["misplaced"] <= MISPLACED_LIMIT
    assert 0.95 < told["energy_kept"] < 1
    assert told["depths_mm"] == "1000, 2000"
    assert told["efl_mm"] == 20.0


def test_streaks_are_frozen_by_their_parts_and_what_that_costs_is_told(
    optics: PlateOptics, sensor: PlanesSensor, tmp_path: Path
) -> None:
    frozen, told = freeze_plate(optics, sensor=sensor, grid=replace(SMALL, max_side_px=81))
    streaks = frozen.streaks
    assert streaks is not None
    assert (told["form"], told["plate"]) == ("streaks", "cross")
    assert sorted(np.degrees(streaks.angles_rad).round() % 360) == [0, 90, 180, 270]
    assert told["misplaced"] <= STREAKS_LIMIT
    light = streaks.dense()[0]
    off = _off(optics, sensor, light, streaks.wavelengths_um)
    assert told["misplaced"] == pytest.approx(off, rel=0.1)
    assert told["side_px"] == light.shape[-1]
    assert told["energy_kept"] == pytest.approx(light.sum((-2, -1)).min(), abs=3e-3)
    with pytest.raises(ContractError, match=r"wanted 0\.9999"):
        freeze_plate(
            optics,
            sensor=sensor,
            grid=replace(SMALL, max_side_px=81, energy=0.9999, least_energy=None),
        )


def test_a_window_that_holds_too_little_is_refused(
    optics: PlateOptics, sensor: PlanesSensor, tmp_path: Path
) -> None:
    with pytest.raises(ContractError, match=r"hold 0\.9"):
        freeze_plate(optics, sensor=sensor, grid=replace(SMALL, max_side_px=21, least_energy=None))


def test_colours_that_no_number_of_wavelengths_places_are_refused(
    optics: PlateOptics,
    sensor: PlanesSensor,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(freezing, "WAVELENGTH_COUNTS", (1,))
    monkeypatch.setattr(freezing, "STREAKS_LIMIT", 0.0)
    with pytest.raises(ContractError, match="1 wavelengths misplace 0"):
        freeze_plate(optics, sensor=sensor, grid=SMALL)


def test_the_command_freezes_a_plate(optics: PlateOptics, tmp_path: Path) -> None:
    tiny = replace(
        optics.plate,
        bench=replace(BENCH, diameter_mm=1.0),
        height_um=torch.zeros(32, 32),
    )
    write_plate(tiny, tmp_path / "flat.toml")
    out = tmp_path / "psf.safetensors"
    arguments = ["freeze", str(tmp_path / "flat.toml"), "-o", str(out), "--max-side-px", "31"]
    done = CliRunner().invoke(app, [*arguments, "--json"])
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout.strip().splitlines()[-1])
    assert told["side_px"] == 31
    assert 0.9 < told["energy_kept"] < 1
    assert read_psf(out).symmetry == "uniform"
    again = CliRunner().invoke(app, arguments)
    assert "psf.safetensors exists; add" in str(again.exception)
    missing = [*arguments[:3], str(tmp_path / "x.safetensors"), "--energy", "0.9999"]
    short = CliRunner().invoke(app, [*missing, "--max-side-px", "31"])
    assert "wanted 0.9999" in str(short.exception)
    assert not (tmp_path / "x.safetensors").exists()
