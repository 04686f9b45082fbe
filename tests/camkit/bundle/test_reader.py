"""Bundles are read in place; every hostile or damaged one is refused by its own message."""

import hashlib
import io
import json
import math
import stat
import threading
import warnings
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors.numpy import load, save

from camkit.bundle import reader
from camkit.bundle.container import MAX_MEMBERS, check_name
from camkit.bundle.haze_file import haze_to_bytes
from camkit.bundle.manifest import format_of
from camkit.bundle.psf_file import psf_to_bytes
from camkit.bundle.reader import Bundle, bundle_from_bytes, find_bundle, open_bundle
from camkit.bundle.writer import bundle_to_bytes, write_bundle
from camkit.errors import BundleError
from tests.bundle_factory import (
    tiny_facts,
    tiny_manifest,
    tiny_members,
    tiny_optics,
    tiny_psf,
    tiny_stages,
    write_tiny_bundle,
)
from tests.deep_bundle import deep_psf, write_deep_bundle
from tests.disk_watch import nothing_written
from tests.focus_bundle import write_focus_bundle
from tests.haze_bundle import hazy_manifest, hazy_optics
from tests.haze_factory import tiny_haze
from tests.psf_factory import streak_kernel, uniform_psf

GOOD = bundle_to_bytes(tiny_manifest(), tiny_members())
EXAMPLE = Path(__file__).resolve().parents[2] / "data" / "example-1.0.camkit"
EXAMPLE_SHA256 = "51b0e691b3d2703d1dfc6832fb027222225ac6cbcde44f0622c0c87cb68a21f7"


def _contents() -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(GOOD)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def _zip(contents: dict[str, bytes], **extra: Callable[[zipfile.ZipFile], object]) -> bytes:
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # zipfile warns of duplicate names
        with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, data in contents.items():
                archive.writestr(name, data)
            for add in extra.values():
                add(archive)
    return buffer.getvalue()


def _with_manifest(change: Callable[[dict[str, Any]], object]) -> bytes:
    contents = _contents()
    document = json.loads(contents["manifest.json"])
    change(document)
    return _zip(contents | {"manifest.json": json.dumps(document).encode()})


def _with_member(name: str, data: bytes) -> bytes:
    return bundle_to_bytes(tiny_manifest(), tiny_members() | {name: data})


def _with_name(name: str) -> bytes:
    return _zip(_contents(), add=lambda archive: archive.writestr(zipfile.ZipInfo(name), b"x"))


def _with_mode(mode: int) -> bytes:
    info = zipfile.ZipInfo("link")
    info.create_system = 3
    info.external_attr = mode << 16
    return _zip(_contents(), add=lambda archive: archive.writestr(info, b"/etc/passwd"))


def _refuse(data: bytes, message: str, **limits: int) -> None:
    with nothing_written(), pytest.raises(BundleError, match=message):
        bundle_from_bytes(data, path=Path("hostile.camkit"), **limits)


# ---------------------------------------------------------------------------- names


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("../escape", r"leads out of the bundle"),
        ("..", r"leads out of the bundle"),
        ("a/../../b", r"leads out of the bundle"),
        ("/etc/passwd", "is absolute"),
        ("C:evil", "drive letter"),
        ("c:/evil", "drive letter"),
        ("..\\evil", "backslash"),
        ("\\\\server\\share", "backslash"),
        ("folder/file", "a bundle is flat"),
        ("folder/", "a bundle is flat"),
        (".hidden", "not plain letters"),
        ("sp ace", "not plain letters"),
        ("é", "not plain letters"),
        ("x" * 300, "not plain letters"),
        ("con\n", "not plain letters"),
    ],
)
def test_names_that_are_no_plain_file_names_are_refused(name: str, message: str) -> None:
    _refuse(_with_name(name), message)


def test_name_cut_by_a_null_byte_is_refused() -> None:
    data = _zip(_contents() | {"cardXmd": b""}).replace(b"cardXmd", b"card\0md")
    _refuse(data, "not plain letters")


@pytest.mark.parametrize("name", ["manifest.json", "network_m.fp16.onnx", "a", "0-9_Z.b"])
def test_plain_names_are_admitted(name: str) -> None:
    check_name(name)


def test_duplicate_name_is_refused() -> None:
    _refuse(
        _zip(_contents(), again=lambda archive: archive.writestr("card.md", b"other")),
        "2 members named 'card.md'",
    )


def test_symbolic_link_is_refused() -> None:
    _refuse(_with_mode(stat.S_IFLNK | 0o777), "symbolic link")


@pytest.mark.parametrize("kind", [stat.S_IFIFO, stat.S_IFCHR, stat.S_IFBLK, stat.S_IFDIR])
def test_special_file_is_refused(kind: int) -> None:
    _refuse(_with_mode(kind | 0o644), "special file")


# ---------------------------------------------------------------------------- sizes


def test_compression_bomb_is_refused() -> None:
    _refuse(_zip(_contents() | {"bomb": bytes(10**7)}), "a ratio above 100 is refused")


def _set_header_size(data: bytes, name: bytes, size: int) -> bytes:
    """Let both headers of a member state another uncompressed size."""
    patched = bytearray(data)
    for magic, size_at, name_at in ((b"PK\x03\x04", 22, 30), (b"PK\x01\x02", 24, 46)):
        start = 0
        while (at := patched.find(magic, start)) >= 0:
            if patched[at + name_at : at + name_at + len(name)] == name:
                patched[at + size_at : at + size_at + 4] = size.to_bytes(4, "little")
            start = at + 4
    return bytes(patched)


def test_bomb_whose_header_lies_is_not_unpacked() -> None:
    data = _set_header_size(_zip(_contents() | {"bomb": bytes(10**7)}), b"bomb", 5)
    contents_hash = hashlib.sha256(bytes(5)).hexdigest()
    document = json.loads(_contents()["manifest.json"])
    document["members"]["bomb"] = {"sha256": contents_hash, "size": 5}
    contents = _contents() | {"manifest.json": json.dumps(document).encode(), "bomb": bytes(10**7)}
    _refuse(_set_header_size(_zip(contents), b"bomb", 5), "damaged|ratio")
    _refuse(data, "not in the manifest")


def test_header_that_promises_more_than_there_is_is_refused() -> None:
    size = len(tiny_members()["network_m.onnx"])
    _refuse(_set_header_size(GOOD, b"network_m.onnx", 3 * size), f"unpacks to {size} bytes")


def test_more_than_the_cap_is_refused() -> None:
    total = sum(map(len, _contents().values()))
    _refuse(_zip(_contents()), f"unpacks to {total} bytes", max_bytes=total - 1)
    _refuse(GOOD, "larger than the cap", max_bytes=1000)


def test_file_over_the_cap_is_not_read_to_its_end(tmp_path: Path) -> None:
    path = write_tiny_bundle(tmp_path)
    with nothing_written(), pytest.raises(BundleError, match="larger than the cap of 1000"):
        open_bundle(path, max_bytes=1000)


@pytest.mark.parametrize("count", [MAX_MEMBERS, 5000])
def test_too_many_members_are_refused(count: int) -> None:
    _refuse(_zip(_contents() | {f"m{i}": b"" for i in range(count)}), "too many members")


# ---------------------------------------------------------------------------- the zip itself


@pytest.mark.parametrize("data", [b"", b"hello", b"\x89PNG\r\n", b"x" + GOOD])
def test_file_that_is_no_zip_is_refused(data: bytes) -> None:
    _refuse(data, "not a zip")


@pytest.mark.parametrize("cut", [30, 1000, len(GOOD) - 30])
def test_truncated_zip_is_refused(cut: int) -> None:
    _refuse(GOOD[:cut], "damaged zip")


def test_encrypted_member_is_refused() -> None:
    data = bytearray(GOOD)
    at = data.rfind(b"PK\x01\x02")
    data[at + 8] |= 1
    _refuse(bytes(data), "is encrypted")


def test_unknown_compression_is_refused() -> None:
    _refuse(
        _zip(
            _contents(),
            add=lambda archive: archive.writestr("packed", b"x" * 99, zipfile.ZIP_BZIP2),
        ),
        "compression 12; only stored and deflate",
    )


def test_damaged_member_is_refused() -> None:
    data = bytearray(GOOD)
    at = data.find(b"# tiny")
    data[at] ^= 1
    _refuse(bytes(data), "card.md is damaged")


@settings(max_examples=120, deadline=None)
@given(position=st.integers(0, len(GOOD) - 1), value=st.integers(0, 255))
def test_a_changed_byte_is_harmless_or_a_bundle_error(position: int, value: int) -> None:
    data = bytearray(GOOD)
    data[position] = value
    try:
        bundle = bundle_from_bytes(bytes(data), path=Path("flipped.camkit"))
    except BundleError:
        return
    members = tiny_members()
    assert {name: bundle.member(name) for name in bundle.names} == members


# ---------------------------------------------------------------------------- manifest and members


def test_missing_manifest_is_refused() -> None:
    contents = _contents()
    del contents["manifest.json"]
    _refuse(_zip(contents), "no manifest.json")


def test_bad_json_is_refused() -> None:
    _refuse(_zip(_contents() | {"manifest.json": b"{'no': json}"}), "cannot be read: .*JSON")


def test_huge_manifest_is_refused() -> None:
    noise = np.random.default_rng(0).bytes(2**20 + 1)
    _refuse(_zip(_contents() | {"manifest.json": noise}), "manifest.json is larger")


@pytest.mark.parametrize("version", ["1.1", "2.13", "3.0"])
def test_newer_format_is_refused_naming_the_version_needed(version: str) -> None:
    data = _with_manifest(lambda document: document.update(format_version=version))
    _refuse(data, f"update to a camkit that reads format {version}")


def test_member_not_in_the_manifest_is_refused() -> None:
    _refuse(_zip(_contents() | {"extra.bin": b"?"}), "not in the manifest: extra.bin")


def test_manifest_entry_without_member_is_refused() -> None:
    contents = _contents()
    del contents["card.md"]
    _refuse(_zip(contents), "not there: card.md")


def test_wrong_hash_is_refused() -> None:
    other = tiny_members()["card.md"].swapcase()
    _refuse(_zip(_contents() | {"card.md": other}), "card.md has the hash")


def test_wrong_size_is_refused() -> None:
    _refuse(_zip(_contents() | {"card.md": b"short"}), "card.md has 5 bytes")


def test_manifest_that_lists_itself_is_refused() -> None:
    fact = {"sha256": "0" * 64, "size": 1}
    _refuse(_with_manifest(lambda d: d["members"].update({"manifest.json": fact})), "lists itself")


def test_heights_of_a_plate_that_is_not_there_are_refused() -> None:
    members = tiny_members() | {"plate.safetensors": b"heights"}
    data = bundle_to_bytes(tiny_manifest(), members)
    _refuse(data, r"plate\.safetensors holds needs the member plate\.toml")
    whole = bundle_to_bytes(tiny_manifest(), members | {"plate.toml": b"a plate"})
    assert bundle_from_bytes(whole, path=Path("x.camkit")).member("plate.toml") == b"a plate"


@pytest.mark.parametrize(
    ("absent", "user"),
    [
        ("network_m.onnx", "network M"),
        ("psf.safetensors", "the optics"),
        ("golden.safetensors", "golden cases"),
    ],
)
def test_missing_part_is_named_with_its_user(absent: str, user: str) -> None:
    members = tiny_members()
    del members[absent]
    _refuse(bundle_to_bytes(tiny_manifest(), members), f"{user}.* needs the member {absent}")


def test_missing_fp16_network_is_refused() -> None:
    facts = tiny_facts().model_copy(update={"fp16_member": "network_m.fp16.onnx"})
    manifest = tiny_manifest(networks={"restore": {"M": facts}})
    data = bundle_to_bytes(manifest, tiny_members())
    _refuse(data, r"network M \(restore\) in fp16 needs")


# ---------------------------------------------------------------------------- PSF


@pytest.mark.parametrize(
    ("value", "message"),
    [(np.nan, "NaN or inf"), (-0.5, "negative"), (0.5, "must sum to 1")],
)
def test_psf_that_is_none_is_refused(value: float, message: str) -> None:
    tensors = load(psf_to_bytes(tiny_psf()))
    tensors["kernels"] = tensors["kernels"].copy()
    tensors["kernels"][1, 0, 2, 2, 2] = value
    _refuse(_with_member("psf.safetensors", save(tensors)), message)


def test_psf_of_another_pitch_is_refused() -> None:
    _refuse(
        _with_member("psf.safetensors", psf_to_bytes(tiny_psf(pitch_um=5.0))),
        "sampled at 5.0 um, the manifest says 6.0 um",
    )


def test_psf_of_another_symmetry_is_refused() -> None:
    other = psf_to_bytes(replace(uniform_psf(streak_kernel(0), channels=3), pixel_pitch_um=6.0))
    _refuse(_with_member("psf.safetensors", other), "is uniform, the manifest says radial")
    manifest = tiny_manifest(optics=tiny_optics(symmetry="uniform"))
    _refuse(bundle_to_bytes(manifest, tiny_members()), "is radial, the manifest says uniform")
    good = bundle_to_bytes(manifest, tiny_members() | {"psf.safetensors": other})
    assert bundle_from_bytes(good, path=Path("x.camkit")).psf.symmetry == "uniform"


def test_psf_of_other_channels_is_refused() -> None:
    one = replace(tiny_psf(), distortion=uniform_psf(streak_kernel(0)).distortion)
    message = r"distortion of 1 channel\(s\), the sensor 3"
    _refuse(_with_member("psf.safetensors", psf_to_bytes(one)), message)


def test_psf_without_optics_is_refused() -> None:
    left_out = "wiener", "network", "illumination", "undistort"
    manifest = tiny_manifest(stages=tiny_stages(*left_out), optics=None, networks={})
    _refuse(bundle_to_bytes(manifest, tiny_members()), "its manifest states no optics")


# ---------------------------------------------------------------------------- what a good one gives


def test_bundle_gives_its_members_without_touching_the_disk(tmp_path: Path) -> None:
    path = write_tiny_bundle(tmp_path)
    with nothing_written():
        bundle = open_bundle(path)
        members = {name: bundle.member(name) for name in bundle.names}
    assert members == tiny_members()
    assert bundle.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert bundle.network_bytes("restore", "M") == members["network_m.onnx"]
    assert bundle.psf.kernels.shape == (2, 1, 3, 5, 5)
    assert bundle.stress_psf() is None


def test_stress_psf_is_read_as_a_psf() -> None:
    data = _with_member("stress_psf.safetensors", psf_to_bytes(tiny_psf()))
    stress = bundle_from_bytes(data, path=Path("x.camkit")).stress_psf()
    assert stress is not None
    np.testing.assert_array_equal(stress.kernels, tiny_psf().kernels)


def _with_stress(**members: bytes) -> bytes:
    named = {f"{name}.safetensors": data for name, data in members.items()}
    return bundle_to_bytes(hazy_manifest(), hazy_optics().members | named)


def test_stress_haze_is_read_beside_its_kernels() -> None:
    psf, haze = psf_to_bytes(tiny_psf()), haze_to_bytes(tiny_haze())
    assert _bundle().stress_haze() is None
    both = bundle_from_bytes(_with_stress(stress_psf=psf, stress_haze=haze), path=Path("x.camkit"))
    found = both.stress_haze()
    assert found is not None
    np.testing.assert_array_equal(found.kernels, tiny_haze().kernels)
    _refuse(_with_stress(stress_haze=haze), "what stress_haze.safetensors holds needs the member")
    plain = tiny_members() | {"stress_psf.safetensors": psf, "stress_haze.safetensors": haze}
    _refuse(bundle_to_bytes(tiny_manifest(), plain), "states no such optics")
    other = psf_to_bytes(deep_psf())
    odd = bundle_from_bytes(_with_stress(stress_psf=other, stress_haze=haze), path=Path("x.camkit"))
    with pytest.raises(BundleError, match=r"stress_haze\.safetensors is not of stress_psf"):
        odd.stress_haze()


def _bundle() -> Bundle:
    return bundle_from_bytes(GOOD, path=Path("tiny.camkit"))


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda bundle: bundle.member("nothing"), "no member 'nothing'"),
        (
            lambda bundle: bundle.network_bytes("restore", "L"),
            "no network of size 'L' for restore; it has: M",
        ),
        (lambda bundle: bundle.network_bytes("sharpen", "M"), "for sharpen; it has: none"),
        (lambda bundle: bundle.network_bytes("restore", "M", fp16=True), "no fp16 network"),
    ],
)
def test_what_is_not_there_is_named(ask: Callable[[Bundle], object], message: str) -> None:
    with pytest.raises(BundleError, match=message):
        ask(_bundle())


def test_bundle_without_psf_says_so() -> None:
    left_out = "wiener", "network", "illumination", "undistort"
    manifest = tiny_manifest(stages=tiny_stages(*left_out), optics=None, networks={})
    members = tiny_members()
    del members["psf.safetensors"]
    bundle = bundle_from_bytes(bundle_to_bytes(manifest, members), path=Path("x.camkit"))
    with pytest.raises(BundleError, match=r"has no psf\.safetensors"):
        _ = bundle.psf


def test_threads_may_share_a_bundle() -> None:
    bundle, wrong = _bundle(), []
    expected = tiny_members()

    def read() -> None:
        names = bundle.names * 5
        wrong.extend(name for name in names if bundle.member(name) != expected[name])

    threads = [threading.Thread(target=read) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []


# ---------------------------------------------------------------------------- finding


def test_path_of_a_file_is_taken_as_it_is(tmp_path: Path) -> None:
    path = write_tiny_bundle(tmp_path)
    assert find_bundle(path) == path
    assert find_bundle(str(path)) == path


def test_built_in_bundle_is_found_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_tiny_bundle(tmp_path)
    monkeypatch.setattr(reader, "built_in_bundles", lambda: {"tiny": path})
    assert find_bundle("tiny") == path
    with pytest.raises(BundleError, match=r"did you mean tiny\?"):
        find_bundle("tinny")
    with pytest.raises(BundleError, match="there are: tiny"):
        find_bundle("zzzz")


@pytest.mark.parametrize("name", ["missing.camkit", "folder/missing"])
def test_missing_file_is_a_bundle_error(name: str) -> None:
    with pytest.raises(BundleError, match="no bundle file"):
        find_bundle(name)


def test_unreadable_path_is_a_bundle_error(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match="cannot read the bundle"):
        open_bundle(tmp_path)


def test_every_built_in_bundle_opens() -> None:
    for name, path in reader.built_in_bundles().items():
        assert open_bundle(path).manifest.name == name


# ---------------------------------------------------------------------------- kept for ever


def test_example_of_format_1_0_opens_for_ever() -> None:
    bundle = open_bundle(EXAMPLE)
    assert EXAMPLE.stat().st_size < 100_000
    assert bundle.manifest.sensor.noise_at(100).shot[0] == pytest.approx(1.0427528e-4)
    assert bundle.psf.wavelengths_um.tolist() == [0.45, 0.55, 0.62]
    assert bundle.psf.symmetry == "radial"
    assert [stage.type for stage in bundle.manifest.stages][:5] == [
        *("linearise", "repair", "white_balance", "demosaic", "wiener"),
    ]
    assert bundle.network_bytes("restore", "M") == bundle.member("network_m.onnx")
    assert bundle.member("card.md").startswith(b"# tiny")
    assert hashlib.sha256(EXAMPLE.read_bytes()).hexdigest() == EXAMPLE_SHA256


@pytest.mark.parametrize(
    ("depths_mm", "expected_mm"),
    [
        ((500.0, 1000.0, 2000.0), 1000.0),
        ((700.0, 1500.0), 1000.0),
        ((1500.0, math.inf), 1500.0),
        ((500.0,), 500.0),
    ],
)
def test_the_reference_depth_is_the_focus_or_the_nearest_depth_of_the_psf(
    depths_mm: tuple[float, ...], expected_mm: float, tmp_path: Path
) -> None:
    assert write_deep_bundle(tmp_path, depths_mm=depths_mm).reference_depth_mm == expected_mm
    assert open_bundle(write_tiny_bundle(tmp_path)).reference_depth_mm == math.inf


def test_kernels_of_a_moved_sensor_need_the_format_that_brought_them(tmp_path: Path) -> None:
    bundle = write_focus_bundle(tmp_path)
    assert bundle.manifest.format_version == "2.5"
    assert write_focus_bundle(tmp_path, moved=False).manifest.format_version == "2.4"
    members = {name: bundle.member(name) for name in bundle.names}
    older = bundle.manifest.model_copy(update={"format_version": "2.4"})
    with pytest.raises(BundleError, match=r"moved sensor, which format 2.5 brought, .* states 2.4"):
        write_bundle(tmp_path / "older.camkit", older, members)


def test_even_powers_of_distortion_need_the_format_that_brought_them(tmp_path: Path) -> None:
    psf = tiny_psf()
    bent = replace(psf.distortion, even_coefficients=np.full((3, 3), 0.001))
    changed = replace(psf, distortion=bent)
    assert (format_of(psf, ()), format_of(changed, ())) == ("2.4", "2.6")
    members = tiny_members() | {"psf.safetensors": psf_to_bytes(changed)}
    newer = tiny_manifest(format_version="2.6")
    written = write_bundle(tmp_path / "newer.camkit", newer, members)
    np.testing.assert_array_equal(written.distortion.row(2)[4:], 0.001)
    with pytest.raises(BundleError, match=r"even powers .* format 2.6 brought, .* states 2.5"):
        write_bundle(tmp_path / "old.camkit", tiny_manifest(format_version="2.5"), members)
