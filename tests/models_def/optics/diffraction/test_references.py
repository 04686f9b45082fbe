"""The plates that come with camkit are read as written, and send light where they say."""

from pathlib import Path

import pytest
import torch

from camkit.models_def.optics.diffraction.plate import (
    PLATES,
    Plate,
    built_in_plates,
    is_plate,
    pattern_plate,
    read_plate,
    write_plate,
)
from camkit.models_def.optics.diffraction.references import (
    CELLS,
    PITCH_UM,
    star_plate,
)
from camkit.models_def.optics.diffraction.shares import find_streaks, shares
from camkit.models_def.optics.diffraction.wave import PixelGrid

NAMES = ("streak-3", "streak-4", "streak-cross", "dual-peak", "bare-lens")
MADE = tuple(read_plate(Path(name)) for name in NAMES)
GRID = PixelGrid(side_px=301, pitch_um=PITCH_UM)


@pytest.mark.parametrize("lines", [3, 4])
def test_a_star_that_comes_with_camkit_is_what_its_maker_makes(lines: int) -> None:
    shipped, plate = read_plate(Path(f"streak-{lines}")), star_plate(lines)
    assert torch.equal(shipped.height_um, plate.height_um)
    assert (shipped.bench, shipped.etching) == (plate.bench, plate.etching)


@pytest.mark.parametrize("plate", MADE, ids=lambda plate: plate.name)
def test_what_comes_with_camkit_is_what_it_is_written_as(plate: Plate, tmp_path: Path) -> None:
    assert is_plate(Path(plate.name))
    write_plate(plate, tmp_path / f"{plate.name}.toml")
    text = (tmp_path / f"{plate.name}.toml").read_text("utf-8")
    assert text == (PLATES / f"{plate.name}.toml").read_text("utf-8")
    assert [path.name for path in tmp_path.iterdir()] == [f"{plate.name}.toml"]


def test_every_built_in_plate_opens_and_is_small() -> None:
    assert {plate.name for plate in MADE} <= set(built_in_plates())
    for name in built_in_plates():
        plate = read_plate(Path(name))
        assert plate.name == name
        assert plate.height_um.shape == (CELLS, CELLS)
    for path in PLATES.iterdir():
        if path.is_file():
            assert path.stat().st_size < 100_000, path


@pytest.mark.parametrize(
    ("plate", "angles", "added"),
    [(MADE[0], [0, 60, 120], 0.053), (MADE[1], [0, 45, 90, 135], 0.053), (MADE[2], [0, 90], 0.053)],
    ids=lambda value: getattr(value, "name", ""),
)
def test_stars_write_their_lines(plate: Plate, angles: list[int], added: float) -> None:
    psf, bare = (plate.psf(0.55, GRID, 5000.0, bare=bare) for bare in (False, True))
    found = find_streaks(psf, bare)
    assert sorted(round(streak.angle_deg) % 180 for streak in found) == angles
    assert all(streak.reach_px == pytest.approx(120, abs=4) for streak in found)
    more = shares(psf, found).streak - shares(bare, found).streak
    assert more == pytest.approx(added, abs=0.006)
    assert shares(bare, found).core == pytest.approx(0.966, abs=0.001)


def test_the_dual_peak_lies_thirty_pixels_away() -> None:
    psf = MADE[3].psf(0.55, GRID, 5000.0)
    place = torch.arange(301) - 150
    there = (place[None] - 26) ** 2 + (place[:, None] - 15) ** 2 <= 16
    opposite = (place[None] + 26) ** 2 + (place[:, None] + 15) ** 2 <= 16
    assert float(psf[there].sum()) == pytest.approx(0.095, abs=0.01)
    assert float(psf[opposite].sum()) < 0.002


def test_a_plate_of_a_map_of_few_numbers_is_a_small_file(tmp_path: Path) -> None:
    from camkit.models_def.optics.diffraction.heights import RankMap
    from camkit.models_def.optics.diffraction.map_numbers import numbers_of

    made = RankMap(200, rank=3, start=0.3)
    plate = Plate(
        name="rank",
        glass="SILICA",
        bench=MADE[0].bench,
        height_um=made().detach(),
        numbers=numbers_of(made),
    )
    write_plate(plate, tmp_path / "rank.toml")
    assert (tmp_path / "rank.safetensors").stat().st_size < 6000
    again = read_plate(tmp_path / "rank.toml")
    assert torch.equal(again.height_um, plate.height_um)
    assert again.numbers is not None


def test_a_pattern_is_drawn_with_cells_of_any_number() -> None:
    pattern = MADE[1].pattern
    assert pattern is not None
    plate = pattern_plate("coarse", pattern, cells=512, bench=MADE[1].bench)
    assert plate.height_um.shape == (512, 512)
