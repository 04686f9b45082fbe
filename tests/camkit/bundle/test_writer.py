"""A bundle appears complete or not at all, and the same content is the same bytes."""

import io
import zipfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.bundle.container import MAX_RATIO
from camkit.bundle.reader import bundle_from_bytes, open_bundle
from camkit.bundle.stages import Network
from camkit.bundle.writer import bundle_to_bytes, write_bundle, write_physics
from camkit.errors import BundleError
from tests.bundle_factory import tiny_manifest, tiny_members, tiny_sensor, tiny_stages
from tests.disk_watch import nothing_written
from tests.haze_bundle import hazy_optics, hazy_stages

NAMES = st.from_regex(r"[a-z][a-z0-9_.-]{0,20}", fullmatch=True).filter(
    lambda name: name not in {"manifest.json", *tiny_members()}
)


@settings(max_examples=40, deadline=None)
@given(extra=st.dictionaries(NAMES, st.binary(max_size=500), max_size=5))
def test_members_come_back_whatever_they_hold(extra: dict[str, bytes]) -> None:
    members = tiny_members() | extra
    data = bundle_to_bytes(tiny_manifest(), members)
    bundle = bundle_from_bytes(data, path=Path("x.camkit"))
    assert {name: bundle.member(name) for name in bundle.names} == members
    assert bundle.manifest == tiny_manifest().model_copy(
        update={"members": bundle.manifest.members}
    )


def test_same_content_in_other_order_is_the_same_bytes() -> None:
    backwards = dict(reversed(tiny_members().items()))
    assert bundle_to_bytes(tiny_manifest(), backwards) == bundle_to_bytes(
        tiny_manifest(), tiny_members()
    )


def test_written_bundle_opens_and_leaves_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a.camkit"
    written = write_bundle(path, tiny_manifest(), tiny_members())
    assert open_bundle(path).sha256 == written.sha256
    assert list(tmp_path.iterdir()) == [path]


def test_old_bundle_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "a.camkit"
    path.write_bytes(b"old")
    write_bundle(path, tiny_manifest(), tiny_members())
    assert open_bundle(path).manifest.name == "tiny"


def test_bundle_that_a_reader_would_refuse_is_not_written(tmp_path: Path) -> None:
    with nothing_written(), pytest.raises(BundleError, match="leads out"):
        write_bundle(tmp_path / "a.camkit", tiny_manifest(), tiny_members() | {"../x": b""})
    assert list(tmp_path.iterdir()) == []


def test_failed_rename_leaves_no_part(tmp_path: Path) -> None:
    (tmp_path / "a.camkit").mkdir()
    with pytest.raises(OSError, match="directory"):
        write_bundle(tmp_path / "a.camkit", tiny_manifest(), tiny_members())
    assert [path.name for path in tmp_path.iterdir()] == ["a.camkit"]


@pytest.mark.parametrize("size", [10, 10_000, 2_000_000])
def test_members_that_shrink_too_well_are_stored(size: int) -> None:
    members = tiny_members() | {"zeros": bytes(size)}
    data = bundle_to_bytes(tiny_manifest(), members)
    assert bundle_from_bytes(data, path=Path("x")).member("zeros") == bytes(size)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        info = archive.getinfo("zeros")
    assert info.file_size <= MAX_RATIO * info.compress_size


def test_a_camera_of_physics_alone_states_its_optics_planes_and_format(tmp_path: Path) -> None:
    optics, path = hazy_optics(), tmp_path / "a.camkit"
    made = write_physics(path, hazy_stages(), tiny_sensor(), optics, 500.0, name="bare")
    known = open_bundle(path).manifest
    assert known == made.manifest
    assert (known.format_version, known.name, known.networks) == ("2.7", "bare", {})
    assert (known.licence, known.training_data) == ("Apache-2.0", "none: no network")
    assert known.optics == optics.entry(500.0)
    assert known.products == {"image": known.stages[-1].gives[0]}
    assert set(made.names) == set(optics.members)
    said = {"name": "bare", "licence": "MIT", "version": "2.0.0"}
    own = write_physics(path, hazy_stages(), tiny_sensor(), optics, float("inf"), **said)
    assert (own.manifest.licence, own.manifest.version) == ("MIT", "2.0.0")
    assert own.reference_depth_mm == float("inf")


def test_a_camera_of_physics_alone_has_no_network(tmp_path: Path) -> None:
    stages = tiny_stages()
    assert any(isinstance(stage, Network) for stage in stages)
    with nothing_written(), pytest.raises(BundleError, match="network"):
        write_physics(tmp_path / "a.camkit", stages, tiny_sensor(), hazy_optics(), 500.0, name="x")
