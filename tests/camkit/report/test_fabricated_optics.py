import dataclasses
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.psf_file import psf_to_bytes
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.writer import write_bundle
from camkit.errors import ContractError
from camkit.psf import FrozenPsf
from camkit.report import fabricated_optics as fabricated
from camkit.report.fabricated_optics import fabricated_optics, lens_text
from tests.bundle_factory import tiny_manifest, tiny_members, tiny_psf, tiny_sensor
from tests.haze_bundle import hazy_manifest, hazy_optics

LENS = (Path(__file__).resolve().parents[3] / "models_def/prescriptions/duet.toml").read_text()


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    """The lens of duet in front of a small sensor, frozen at 2 fields and 3 wavelengths."""
    path = tmp_path_factory.mktemp("lens") / "small.camkit"
    members = tiny_members() | {
        "psf.safetensors": psf_to_bytes(tiny_psf()),
        "prescription.toml": LENS.encode(),
    }
    write_bundle(path, tiny_manifest(sensor=tiny_sensor(320, 240)), members)
    return open_bundle(path)


def traced(bundle: Bundle, seed: int, folder: Path) -> FrozenPsf:
    optics = fabricated_optics(bundle, seed, cache_folder=folder)
    assert optics.haze is None
    return optics.psf


def test_the_grid_is_twice_and_three_times_as_dense(bundle: Bundle, tmp_path: Path) -> None:
    psf = traced(bundle, 1, tmp_path)
    assert psf.field_heights_mm.size == 2 * 2 - 1
    assert psf.wavelengths_um.size == 3 * 3 - 2
    own = fabricated_optics(bundle, 1, cache_folder=tmp_path, dense=False).psf
    assert own.kernels.shape[:3] == bundle.psf.kernels.shape[:3]


def test_a_lens_that_throws_light_far_gets_the_widest_window(
    bundle: Bundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fabricated, "MAX_SIDE_PX", 3)
    side_px = bundle.psf.kernels.shape[-1] + fabricated.LARGER_PX
    monkeypatch.setattr(fabricated, "ENERGY", 1.0)
    assert traced(bundle, 1, tmp_path).kernels.shape[-1] == side_px
    monkeypatch.setattr(fabricated, "LEAST_ENERGY", 1.0)
    with pytest.raises(ContractError, match="of the light"):
        traced(bundle, 3, tmp_path)


def test_copies_differ_by_seed_and_from_the_design_and_are_kept(
    bundle: Bundle, tmp_path: Path
) -> None:
    first = traced(bundle, 1, tmp_path)
    (kept,) = tmp_path.iterdir()
    before = kept.stat().st_mtime_ns
    again = traced(bundle, 1, tmp_path)
    np.testing.assert_array_equal(first.kernels, again.kernels)
    assert kept.stat().st_mtime_ns == before
    other = traced(bundle, 2, tmp_path)
    assert not np.array_equal(first.distortion.coefficients, other.distortion.coefficients)


def test_a_bundle_without_a_lens_asks_for_one(bundle: Bundle, tmp_path: Path) -> None:
    path = tmp_path / "lens.toml"
    path.write_text(LENS)
    members = {k: v for k, v in bundle.manifest.members.items() if k != "prescription.toml"}
    manifest = bundle.manifest.model_copy(update={"members": members})
    bare = dataclasses.replace(bundle, manifest=manifest)
    with pytest.raises(ContractError, match="--prescription"):
        lens_text(bare, None)
    assert lens_text(bare, path) == LENS == lens_text(bundle, None)


def test_the_haze_of_a_copy_comes_along_and_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "plate.camkit"
    members = hazy_optics().members | {"prescription.toml": LENS.encode()}
    hazy = write_bundle(path, hazy_manifest(), members)
    folder = tmp_path / "kept"
    first = fabricated_optics(hazy, 1, cache_folder=folder)
    assert first.haze is not None
    assert first.haze.cell_px == hazy.haze.cell_px
    assert first.psf.kernels.shape[0] == 3  # the least, the bundle has two
    kept = {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}
    assert sorted(name.split("-")[0] for name in kept) == ["haze", "psf"]
    again = fabricated_optics(hazy, 1, cache_folder=folder)
    assert again.haze is not None
    np.testing.assert_array_equal(first.haze.kernels, again.haze.kernels)
    assert {path.name: path.stat().st_mtime_ns for path in folder.iterdir()} == kept
