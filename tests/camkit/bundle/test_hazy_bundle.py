"""A bundle with a haze beside its core kernels opens; whoever lies about it is refused."""

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors.numpy import load, save

from camkit.bundle.chain import JoinError, check_haze
from camkit.bundle.frozen_optics import FrozenOptics, psf_of_streaks
from camkit.bundle.haze_file import haze_to_bytes
from camkit.bundle.manifest import format_of, planes_of
from camkit.bundle.optics import HAZE, HazyPsfOptics
from camkit.bundle.psf_file import psf_to_bytes
from camkit.bundle.reader import bundle_from_bytes
from camkit.bundle.stages import Dehaze
from camkit.bundle.writer import bundle_to_bytes
from camkit.errors import BundleError, ContractError
from tests.bundle_factory import tiny_manifest, tiny_members, tiny_psf, tiny_stages
from tests.haze_bundle import hazy_manifest, hazy_optics, hazy_stages, write_hazy_bundle
from tests.haze_factory import CELL_PX, tiny_haze
from tests.streak_factory import small_streaks


def test_a_bundle_gives_its_haze(tmp_path: Path) -> None:
    bundle = write_hazy_bundle(tmp_path)
    np.testing.assert_array_equal(bundle.haze.kernels, tiny_haze().kernels)
    np.testing.assert_array_equal(bundle.psf.kernels, tiny_psf().kernels)
    assert bundle.manifest.has_kernels
    assert bundle.manifest.format_version == format_of(bundle.psf, [bundle.manifest]) == "2.7"
    assert format_of(bundle.psf, ()) == "2.4"


def test_optics_say_what_they_hold() -> None:
    optics = hazy_optics()
    assert list(optics.members) == ["psf.safetensors", HAZE]
    assert optics.members["psf.safetensors"] == psf_to_bytes(tiny_psf())
    entry = optics.entry(700.0)
    assert isinstance(entry, HazyPsfOptics)
    assert (entry.cell_px, entry.object_distance_mm) == (CELL_PX, 700.0)
    streaks = small_streaks()
    with pytest.raises(ContractError, match="streaks have a haze of their own"):
        FrozenOptics(psf=psf_of_streaks(streaks, 3), streaks=streaks, haze=tiny_haze())


def test_a_bundle_without_haze_says_so() -> None:
    data = bundle_to_bytes(tiny_manifest(), tiny_members())
    bundle = bundle_from_bytes(data, path=Path("plain.camkit"))
    with pytest.raises(BundleError, match=r"plain.camkit has no haze.safetensors"):
        _ = bundle.haze


def _refused(said: str, members: dict[str, bytes], **changes: Any) -> None:
    data = bundle_to_bytes(hazy_manifest(**changes), members)
    with pytest.raises(BundleError, match=said):
        bundle_from_bytes(data, path=Path("hazy.camkit"))


def test_a_bundle_that_lies_about_its_haze_is_refused() -> None:
    sound = hazy_optics().members
    _refused("which format 2.7 brought", sound, format_version="2.6")
    _refused(
        "haze of the optics needs the member haze", {"psf.safetensors": sound["psf.safetensors"]}
    )
    _refused("has cells of 16 px, the manifest says 8", sound | {HAZE: _with_cells(16)})
    other = psf_to_bytes(tiny_psf(pitch_um=6.0 + 1e-7))
    _refused("is refused: haze is of pixels", sound | {"psf.safetensors": other})


def _with_cells(cell_px: int) -> bytes:
    tensors = load(haze_to_bytes(tiny_haze()))
    tensors["cell_px"] = np.array([float(cell_px)])
    return save(tensors)


def test_a_haze_that_the_manifest_does_not_state_is_refused(tmp_path: Path) -> None:
    members = tiny_members() | {HAZE: haze_to_bytes(tiny_haze())}
    data = bundle_to_bytes(tiny_manifest(), members)
    with pytest.raises(
        BundleError, match=r"holds haze.safetensors, and its manifest states no such"
    ):
        bundle_from_bytes(data, path=tmp_path / "x.camkit")


def test_a_bank_that_leaves_the_haze_does_not_join() -> None:
    with pytest.raises(ValueError, match="no stage haze before it"):
        hazy_manifest(stages=tiny_stages("network"))


def test_a_bank_beside_the_stage_haze_does_not_join() -> None:
    """The stage stands before it, and its light goes elsewhere."""
    stages = tuple(
        stage.model_copy(update={"takes": ("rgb", "unknown")}) if stage.type == "wiener" else stage
        for stage in hazy_stages()
    )
    check_haze(hazy_stages(), hazy_optics().entry(np.inf))
    with pytest.raises(JoinError, match="no stage haze before it"):
        check_haze(stages, hazy_optics().entry(np.inf))


def test_a_stage_needs_a_haze_of_its_cells() -> None:
    manifest = hazy_manifest()
    for stages, parts, said in (
        (hazy_stages(shrink=16), manifest.parts, "16 px, those of the haze of the optics 8"),
        (hazy_stages(), tiny_manifest().parts, "needs optics with a haze .hazy_psf., not frozen"),
    ):
        with pytest.raises(BundleError, match=said):
            planes_of(stages, parts)


def test_a_stage_states_sane_numbers() -> None:
    for wrong in ({"shrink": 7}, {"shrink": 66}, {"terms": 0}, {"rounds": 17}):
        with pytest.raises(ValueError, match="validation error"):
            Dehaze(**wrong)


def test_the_manifest_reads_back_as_it_was(tmp_path: Path) -> None:
    bundle = write_hazy_bundle(tmp_path)
    with zipfile.ZipFile(bundle.path) as file:
        stated = json.loads(file.read("manifest.json"))
    assert stated["optics"]["type"] == "hazy_psf"
    assert [s["type"] for s in stated["stages"]].index("haze") == 4
    assert bundle.manifest == hazy_manifest(members=stated["members"])
