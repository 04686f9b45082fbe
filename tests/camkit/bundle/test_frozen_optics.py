"""Optics are told by their file; bundles of either kind open, and whoever lies is refused."""

import json
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camkit.bundle.frozen_optics import (
    FrozenOptics,
    optics_from_bytes,
    psf_of_streaks,
    read_optics_file,
)
from camkit.bundle.manifest import Manifest
from camkit.bundle.optics import PSF, STREAKS, FrozenPsfOptics, StreakEntry
from camkit.bundle.psf_file import psf_to_bytes
from camkit.bundle.reader import bundle_from_bytes, open_bundle
from camkit.bundle.stages import Highlights, Linearise
from camkit.bundle.streak_file import streaks_to_bytes
from camkit.bundle.writer import bundle_to_bytes
from camkit.errors import BundleError
from camkit.psf import FrozenPsf
from tests.bundle_factory import tiny_manifest, tiny_members, tiny_psf, write_tiny_bundle
from tests.hdr_bundle import four_lines, write_hdr_bundle
from tests.streak_factory import small_streaks

EXAMPLES = Path(__file__).resolve().parents[2] / "data"
FLOAT32 = 1e-6


def _streaks() -> FrozenOptics:
    streaks = small_streaks()
    return FrozenOptics(psf=psf_of_streaks(streaks, 3), streaks=streaks)


# -------------------------------------------------------------------------- the file


def test_a_file_is_streaks_or_kernels_by_what_it_holds(tmp_path: Path) -> None:
    for optics, name in ((_streaks(), STREAKS), (FrozenOptics(psf=tiny_psf()), PSF)):
        member, data = optics.member
        assert member == optics.member_name == name
        (tmp_path / name).write_bytes(data)
        back = read_optics_file(tmp_path / name, channels=3)
        assert back.member == optics.member
        np.testing.assert_array_equal(back.psf.kernels, optics.psf.kernels)


def test_what_is_neither_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match="x is no safetensors file"):
        optics_from_bytes(b"nothing", what="x", channels=3)
    with pytest.raises(BundleError, match=r"cannot read the PSF .*none"):
        read_optics_file(tmp_path / "none", channels=3)


def test_kernels_of_streaks_are_their_dense_kernels_of_sum_1() -> None:
    streaks = small_streaks()
    for bare in (False, True):
        psf = psf_of_streaks(streaks, 2, bare=bare)
        dense = streaks.dense(bare=bare)
        wanted = dense / dense.sum((-2, -1), keepdims=True)
        np.testing.assert_allclose(psf.kernels[0], wanted, rtol=1e-5)
        np.testing.assert_allclose(psf.kernels.sum((-2, -1)), 1, atol=FLOAT32)
        assert psf.symmetry == "uniform"
        assert psf.depths_mm.tolist() == streaks.depths_mm.tolist()
        assert psf.distortion.coefficients.tolist() == [[1, 0, 0, 0]] * 2
        assert psf.relative_illumination.tolist() == [1]


@pytest.mark.parametrize(("distance_mm", "stated"), [(2000.0, 2000.0), (np.inf, None)])
def test_the_entry_says_which_and_where_they_are_sharp(
    distance_mm: float, stated: float | None
) -> None:
    entry = _streaks().entry(distance_mm)
    assert entry == StreakEntry(pixel_pitch_um=6.0, object_distance_mm=stated)
    entry = FrozenOptics(psf=tiny_psf()).entry(distance_mm)
    assert entry == FrozenPsfOptics(
        pixel_pitch_um=6.0, object_distance_mm=stated, symmetry="radial"
    )


# -------------------------------------------------------------------------- the bundle


def test_a_bundle_with_streaks_opens_and_gives_streaks_and_kernels(tmp_path: Path) -> None:
    bundle = write_hdr_bundle(tmp_path)
    assert bundle.manifest.optics is not None
    assert bundle.manifest.optics.type == "streaks"
    assert isinstance(bundle.manifest.stages[4], Highlights)
    assert streaks_to_bytes(bundle.streaks) == streaks_to_bytes(four_lines())
    np.testing.assert_allclose(bundle.psf.kernels.sum((-2, -1)), 1, atol=FLOAT32)
    assert bundle.psf.kernels.shape[-1] == bundle.streaks.side_px
    assert bundle.reference_depth_mm == 5000.0


def test_other_bundles_have_no_streaks(tmp_path: Path) -> None:
    bundle = open_bundle(write_tiny_bundle(tmp_path))
    with pytest.raises(BundleError, match=f"tiny.camkit has no {STREAKS}"):
        _ = bundle.streaks


def test_optics_without_a_type_are_kernels_as_before_there_were_others() -> None:
    """So every bundle of 1.0 to 2.1 says it."""
    for name in ("example-1.0.camkit", "example-2.0.camkit"):
        with zipfile.ZipFile(EXAMPLES / name) as archive:
            document = json.loads(archive.read("manifest.json"))
        assert "type" not in document.get("optics", {}) or name != "example-1.0.camkit"
        bundle = open_bundle(EXAMPLES / name)
        assert isinstance(bundle.manifest.optics, FrozenPsfOptics)
        assert bundle.psf.kernels.ndim == 5
    told = {**tiny_manifest().model_dump(mode="json"), "members": {}}
    told["optics"].pop("type")
    assert isinstance(Manifest.model_validate(told).optics, FrozenPsfOptics)


def _with(
    optics: FrozenPsfOptics | StreakEntry | None, members: dict[str, bytes], *gone: str
) -> bytes:
    """Give a bundle whose manifest says the one and whose members are the other."""
    kept = {name: data for name, data in tiny_members().items() if name not in gone}
    manifest = tiny_manifest().model_copy(update={"optics": optics})
    return bundle_to_bytes(manifest, kept | members)


STATED = StreakEntry(pixel_pitch_um=6.0)
REFUSED: dict[str, tuple[Callable[[], bytes], str]] = {
    "streaks beside kernels": (
        lambda: _with(FrozenPsfOptics(pixel_pitch_um=6.0), {STREAKS: _streaks().member[1]}),
        "holds streaks.safetensors, and its manifest states no such optics",
    ),
    "kernels beside streaks": (
        lambda: _with(STATED, {STREAKS: _streaks().member[1]}),
        "holds psf.safetensors, and its manifest states no such optics",
    ),
    "streaks without their member": (lambda: _with(STATED, {}, PSF), f"needs the member {STREAKS}"),
    "kernels under the name of streaks": (
        lambda: _with(STATED, {STREAKS: psf_to_bytes(tiny_psf())}, PSF),
        "streaks.safetensors holds optics of another type than the manifest states",
    ),
    "streaks under the name of kernels": (
        lambda: _with(
            FrozenPsfOptics(pixel_pitch_um=6.0), {PSF: streaks_to_bytes(small_streaks())}
        ),
        "psf.safetensors holds optics of another type than the manifest states",
    ),
    "damaged streaks": (
        lambda: _with(STATED, {STREAKS: streaks_to_bytes(small_streaks())[:-1]}, PSF),
        "streaks.safetensors is not a sound safetensors file",
    ),
    "streaks of another pitch": (
        lambda: _with(STATED, {STREAKS: streaks_to_bytes(small_streaks(pitch_um=5.0))}, PSF),
        "streaks.safetensors is sampled at 5.0 um, the manifest says 6.0 um",
    ),
}


@pytest.mark.parametrize(("make", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_a_bundle_whose_optics_are_not_what_it_states_is_refused(
    make: Callable[[], bytes], message: str
) -> None:
    with pytest.raises(BundleError, match=message):
        bundle_from_bytes(make(), path=Path("hostile.camkit"))


def test_optics_of_a_bundle_that_states_none_are_refused() -> None:
    manifest = tiny_manifest(
        optics=None, stages=(Linearise(),), networks={}, golden=(), products={"image": "light"}
    )
    data = bundle_to_bytes(manifest, {STREAKS: _streaks().member[1]})
    with pytest.raises(BundleError, match="its manifest states no optics"):
        bundle_from_bytes(data, path=Path("hostile.camkit"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"type": "mirror"}, "mirror"),
        ({"member": PSF}, STREAKS),
        ({"symmetry": "radial"}, "uniform"),
        ({"pixel_pitch_um": 0}, "greater than 0"),
        ({"colour": 1}, "[Ee]xtra"),
    ],
)
def test_an_entry_that_is_none_is_refused(
    tmp_path: Path, change: dict[str, Any], message: str
) -> None:
    path = write_hdr_bundle(tmp_path).path
    with zipfile.ZipFile(path) as archive:
        contents = {name: archive.read(name) for name in archive.namelist()}
    document = json.loads(contents["manifest.json"])
    document["optics"] |= change
    contents["manifest.json"] = json.dumps(document).encode()
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in contents.items():
            archive.writestr(name, data)
    with pytest.raises(BundleError, match=message):
        open_bundle(path)


def test_a_psf_is_whole_whatever_a_plate_loses() -> None:
    """Half of the light beside the kernel changes no kernel."""
    streaks = small_streaks()
    dim = replace(
        streaks, core=streaks.core / 2, profiles=streaks.profiles / 2, haze=streaks.haze / 2
    )
    one, other = (psf_of_streaks(s, 3) for s in (streaks, dim))
    assert isinstance(one, FrozenPsf)
    np.testing.assert_allclose(one.kernels, other.kernels, rtol=1e-5)
