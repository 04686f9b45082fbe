import math
from pathlib import Path
from typing import Any

import pytest
import torch
from safetensors.torch import save

from camkit.bundle.reader import PLATE, PLATE_HEIGHTS
from camkit.bundle.writer import write_bundle
from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.etching import Etching
from camkit.models_def.optics.diffraction.geometry import Bench
from camkit.models_def.optics.diffraction.plate import (
    PLATES,
    Plate,
    built_in_plates,
    plate_members,
    read_plate,
    write_plate,
)
from camkit.models_def.optics.diffraction.plate_optics import PlateOptics
from camkit.models_def.optics.diffraction.wave import PixelGrid
from camkit.models_def.optics.optics_file import read_optics
from tests.hdr_bundle import write_hdr_bundle


def _plate(**changes: Any) -> Plate:
    generator = torch.Generator().manual_seed(1)
    made: dict[str, Any] = {
        "name": 'odd "name"\t\\ é',
        "note": "two\nlines",
        "glass": "SILICA",
        "bench": Bench(diameter_mm=2.0, focal_length_mm=50.0),
        "height_um": 0.3 * torch.rand(64, 64, generator=generator),
        "etching": Etching(range_um=0.3, levels=8),
    }
    return Plate(**{**made, **changes})


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"etching": None},
        {"bench": Bench(diameter_mm=1.0, aperture="square", sensor_mm=5.0)},
        {"etching": Etching(range_um=1.2, wraps=True)},
    ],
)
def test_what_is_written_is_read(tmp_path: Path, changes: dict[str, Any]) -> None:
    plate = _plate(**changes)
    write_plate(plate, tmp_path / "plate.toml")
    again = read_plate(tmp_path / "plate.toml")
    assert (again.name, again.note, again.glass) == (plate.name, plate.note, plate.glass)
    assert (again.bench, again.etching) == (plate.bench, plate.etching)
    assert torch.equal(again.height_um, plate.height_um)


def test_its_psf_is_that_of_the_heights_as_made() -> None:
    plate = _plate()
    grid = PixelGrid(side_px=21, pitch_um=6.0)
    as_designed = _plate(etching=None).psf(0.55, grid)
    assert not torch.allclose(plate.psf(0.55, grid), as_designed, atol=1e-7)
    assert torch.allclose(
        _plate(height_um=plate.made_um, etching=None).psf(0.55, grid), plate.psf(0.55, grid)
    )
    bare = plate.psf(0.55, grid, bare=True)
    assert float(bare[10, 10]) > float(plate.psf(0.55, grid)[10, 10])
    assert plate.cell_um == pytest.approx(31.25)
    assert plate.index(0.55) == pytest.approx(1.4599, abs=1e-4)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("[bench]", "[bank]"), "unknown key 'bank'"),
        (("diameter_mm = 2.0", "diameter_mm = 'x'"), r"bench\.diameter_mm must be a number"),
        (('glass = "SILICA"', 'glass = "SAND"'), "SAND"),
        (('heights = "plate.safetensors"', 'heights = "../plate.safetensors"'), "lie beside it"),
        (
            ('heights = "plate.safetensors"', 'heights = "none.safetensors"'),
            "cannot read the heights",
        ),
        (("levels = 8", "levels = 9"), "levels are 2, 4, 8"),
        (("levels = 8", "steps = 8"), "unknown key 'steps'"),
        (("note", "name"), "not valid TOML"),
    ],
)
def test_a_damaged_file_is_one_error(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    path = tmp_path / "plate.toml"
    write_plate(_plate(), path)
    text = path.read_text(encoding="utf-8")
    assert change[0] in text
    path.write_text(text.replace(change[0], change[1], 1), encoding="utf-8")
    with pytest.raises(ContractError, match=message):
        read_plate(path)


def test_a_plate_without_a_bench_is_refused(tmp_path: Path) -> None:
    write_plate(_plate(etching=None), tmp_path / "plate.toml")
    text = (tmp_path / "plate.toml").read_text(encoding="utf-8")
    (tmp_path / "plate.toml").write_text(text[: text.index("[bench]")], encoding="utf-8")
    with pytest.raises(ContractError, match=r"lacks the table \[bench\]"):
        read_plate(tmp_path / "plate.toml")


@pytest.mark.parametrize("name", built_in_plates())
def test_a_bundle_holds_a_built_in_plate_word_for_word(name: str) -> None:
    """But for the name of its heights, which is that of the member."""
    members = plate_members(read_plate(Path(name)))
    text = (PLATES / f"{name}.toml").read_text(encoding="utf-8")
    heights = PLATES / f"{name}.safetensors"
    assert members[PLATE].decode() == text.replace(heights.name, PLATE_HEIGHTS)
    assert (PLATE_HEIGHTS in members) == heights.is_file()


def _with_plate(folder: Path, members: dict[str, bytes]) -> Path:
    bundle = write_hdr_bundle(folder)
    kept = {name: bundle.member(name) for name in bundle.names}
    return write_bundle(folder / "plated.camkit", bundle.manifest, kept | members).path


def test_the_plate_of_a_bundle_is_read_from_it(tmp_path: Path) -> None:
    plate = _plate()
    path = _with_plate(tmp_path, plate_members(plate))
    again = read_plate(path)
    assert (again.name, again.note, again.bench) == (plate.name, plate.note, plate.bench)
    assert torch.equal(again.height_um, plate.height_um)
    optics = read_optics(path)
    assert isinstance(optics, PlateOptics)
    assert torch.equal(optics.plate.height_um, plate.height_um)


def test_a_bundle_without_a_plate_or_with_a_damaged_one_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ContractError, match=r"streaks\.camkit holds no plate\.toml"):
        read_plate(write_hdr_bundle(tmp_path).path)
    with pytest.raises(ContractError, match=r"plate\.toml of .*plated\.camkit is not valid TOML"):
        read_plate(_with_plate(tmp_path, {PLATE: b"\xff"}))
    with pytest.raises(
        ContractError, match=r"plated\.camkit lacks its heights, plate\.safetensors"
    ):
        read_plate(_with_plate(tmp_path, {PLATE: plate_members(_plate())[PLATE]}))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "is no safetensors file"),
        (b"\xff" * 64, "is no safetensors file"),
        (save({"height": torch.zeros(4, 4)}), "wanted is height_um"),
        (save({"height_um": torch.zeros(4, 5)}), "heights are a square"),
        (save({"height_um": torch.zeros(1, 1)}), "heights are a square"),
        (save({"height_um": torch.zeros(4, 4, dtype=torch.int32)}), "of type float; got"),
        (save({"height_um": torch.full((4, 4), math.nan)}), "not a finite number"),
    ],
)
def test_heights_that_are_none_are_refused(tmp_path: Path, data: bytes, message: str) -> None:
    write_plate(_plate(), tmp_path / "plate.toml")
    (tmp_path / "plate.safetensors").write_bytes(data)
    with pytest.raises(ContractError, match=message):
        read_plate(tmp_path / "plate.toml")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "needs heights or a table"),
        ('heights = "a.safetensors"\n[pattern]\nkind = "flat"', "needs heights or a table"),
        ('heights = "a.safetensors"\ncells = 64', "leave out cells"),
        ('[pattern]\nkind = "flat"', "2 to 16384 cells along a side; got 0"),
        ('cells = 20000\n[pattern]\nkind = "flat"', "2 to 16384 cells along a side; got 20000"),
        ('cells = 64\n[pattern]\nkind = "spiral"', "must be one of star, cross, peak, flat"),
        ('cells = 64\n[pattern]\nkind = ["flat"]', "must be one of star, cross, peak, flat"),
        ("cells = 64\npattern = 3", "must be one of star, cross, peak, flat"),
        ('cells = 64\n[pattern]\nkind = "star"', "pattern lacks angles_deg, far_um"),
        ('cells = 64\n[pattern]\nkind = "flat"\nshare = 1', "unknown key 'share'"),
        (
            'cells = 64\n[pattern]\nkind = "cross"\nnear_um = 1\nfar_um = 2\nshare = 0.5',
            "share lies between 0 and 1/3",
        ),
    ],
)
def test_a_wrong_pattern_is_one_error(tmp_path: Path, text: str, message: str) -> None:
    head, *tables = text.partition("[pattern]")
    bench = "\n[bench]\ndiameter_mm = 2.0\nfocal_length_mm = 50.0\n"
    text = f'name = "x"\nglass = "SILICA"\n{head}{bench}{"".join(tables)}\n'
    (tmp_path / "plate.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ContractError, match=message):
        read_plate(tmp_path / "plate.toml")


def test_a_name_of_no_plate_is_told_those_that_there_are(tmp_path: Path) -> None:
    with pytest.raises(ContractError, match="no plate streak-9: name a file, or one of bare-lens"):
        read_plate(Path("streak-9"))
    with pytest.raises(ContractError, match="cannot read plate"):
        read_plate(tmp_path / "none.toml")
