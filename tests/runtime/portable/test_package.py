"""A reader of 80 lines, with no import of camkit, gives what camkit gives."""

import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest

from camkit.bundle.golden import golden_from_bytes
from camkit.bundle.manifest import GoldenCase, format_of
from camkit.bundle.reader import GOLDEN, Bundle, built_in_bundles, open_bundle
from camkit.bundle.stages import Network, Undistort, Wiener
from camkit.errors import ContractError, UnsupportedError
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.portable.folder import write_files
from camkit.runtime.portable.package import write_portable
from tests.runtime.portable.beside_camkit import bundle_with_rules, camkit_light, decibels
from tools.portable_table import READERS, load_example
from tools.repack import PORTABLE

READER = READERS / "portable_camera.py"
LEAST_DB = 100.0
MOST_BYTES = 12_000_000


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    """Return `duet` with the rules that other readers follow too."""
    return bundle_with_rules("duet", tmp_path_factory.mktemp("bundle"))


@pytest.fixture(scope="module")
def folder(bundle: Bundle, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the portable camera, size S alone."""
    folder = tmp_path_factory.mktemp("portable") / "duet"
    write_portable(bundle, folder, ("S",))
    return folder


@pytest.fixture(scope="module")
def camera(folder: Path) -> Any:
    """Return the camera of the reader."""
    return load_example("portable_camera").PortableCamera(folder, "S")


def _cases(bundle: Bundle) -> dict[str, tuple[GoldenCase, np.ndarray]]:
    """Return golden captures, and one of lamps near the axis, its sides and its origin odd."""
    golden = golden_from_bytes(bundle.member(GOLDEN))
    cases = {case.name: (case, golden[case.name].capture) for case in bundle.manifest.golden}
    saturated, capture = cases["saturated"]
    odd = saturated.model_copy(update={"origin_px": (2911, 1911)})
    return cases | {"lamps_on_the_axis": (odd, np.ascontiguousarray(capture[1:187, 1:191]))}


@pytest.mark.parametrize("name", ["typical", "saturated", "very_dark", "lamps_on_the_axis"])
def test_a_reader_agrees_with_camkit(bundle: Bundle, camera: Any, name: str) -> None:
    case, capture = _cases(bundle)[name]
    facts = capture, case.iso, case.white_balance, case.origin_px
    expected = camkit_light(bundle, capture, case, undistort=False, color="camera")
    assert decibels(camera.develop(*facts, straight=False), expected) >= LEAST_DB
    expected = camkit_light(bundle, capture, case)
    allowed = case.atol + case.rtol * max(1.0, float(np.abs(expected).max()))
    assert np.abs(camera.develop(*facts) - expected).max() <= allowed


def test_blacks_of_single_sites_are_scaled_to_one(bundle: Bundle, camera: Any) -> None:
    """As docs/guides/portable.md says, for a file that states several."""
    blacks, white = np.array([[256.0, 250], [262, 270]]), 4095.0
    case, capture = _cases(bundle)["typical"]
    pipeline = Pipeline(bundle, Options(size="S", threads=1))
    prepared = pipeline.capture_of(
        capture, iso=case.iso, white_balance=case.white_balance, origin_px=case.origin_px
    )
    prepared = replace(prepared, black_level=blacks.astype(np.float32))
    expected = np.asarray(pipeline.start(prepared).fill(product="image"))
    height, width = capture.shape
    site = np.tile(blacks, (height // 2 + 1, width // 2 + 1))[:height, :width]
    black = blacks[0, 0]
    scaled = black + (capture - site) * (white - black) / (white - site)
    facts = scaled, case.iso, case.white_balance, case.origin_px
    assert decibels(camera.develop(*facts, levels=(black, white)), expected) >= LEAST_DB


def test_graphs_keep_to_the_default_domain_of_opset_18_without_control_flow(folder: Path) -> None:
    for path in folder.glob("*.onnx"):
        model = onnx.load(path)
        assert [(one.domain, one.version) for one in model.opset_import] == [("", 18)]
        operators = {node.op_type for node in model.graph.node}
        assert not operators & {"If", "Loop", "Scan", "DFT", "STFT"}, path.name


def test_one_size_takes_twelve_megabytes_at_most(folder: Path) -> None:
    assert sum(path.stat().st_size for path in folder.iterdir()) <= MOST_BYTES


def test_the_reader_is_eighty_lines_of_code() -> None:
    lines = [line.strip() for line in READER.read_text().splitlines()]
    assert sum(bool(line) and not line.startswith('"""') for line in lines) <= 80


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("trio-edof", "its bank finds the distance of the scene in every capture"),
        ("streak-hdr", "stage highlights solves for the light of lamps"),
        ("spad-sr-baselines", "stages super_resolve"),
        ("deglare", "stage deglare searches the whole capture"),
    ],
)
def test_other_cameras_are_refused_by_what_has_no_graph(
    name: str, reason: str, tmp_path: Path
) -> None:
    with pytest.raises(UnsupportedError, match=reason):
        write_portable(open_bundle(built_in_bundles()[name]), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_network_that_takes_other_planes_is_refused(bundle: Bundle, tmp_path: Path) -> None:
    stages = tuple(
        stage.model_copy(update={"takes": ("rgb", "rgb", *stage.takes[2:])})
        if isinstance(stage, Network)
        else stage
        for stage in bundle.manifest.stages
    )
    other = replace(bundle, manifest=bundle.manifest.model_copy(update={"stages": stages}))
    with pytest.raises(UnsupportedError, match="network takes rgb, rgb, not rgb, restored"):
        write_portable(other, tmp_path / "out")


def test_a_zip_holds_what_a_folder_holds_and_nothing_is_left_of_half_a_zip(
    bundle: Bundle, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "new" / "duet.zip"
    write_portable(bundle, out, ("S",))
    with zipfile.ZipFile(out) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    assert members == {path.name: path.read_bytes() for path in folder.iterdir()}
    with pytest.raises(ContractError, match="exists"):
        write_portable(bundle, out, ("S",))
    monkeypatch.setattr(zipfile.ZipFile, "writestr", _fail)
    with pytest.raises(OSError, match="full"):
        write_files(tmp_path / "other.zip", members)
    assert [path.name for path in tmp_path.iterdir()] == ["new"]


def _fail(*_: Any) -> None:
    raise OSError("the disk is full")


def test_a_full_folder_and_an_unknown_size_are_refused(bundle: Bundle, tmp_path: Path) -> None:
    with pytest.raises(ContractError, match="no size L"):
        write_portable(bundle, tmp_path / "out", ("L",))
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(ContractError, match="empty or not exist"):
        write_portable(bundle, tmp_path)


def test_the_rules_of_readers_need_format_2_12_and_are_off_by_default() -> None:
    bank = Wiener(prior_scale=1.0, prior_exponent=2.0)
    assert not bank.whole_blocks
    assert Undistort().places == "float"
    for kind, change in PORTABLE:
        entry = (bank if kind is Wiener else Undistort()).model_copy(update=change)
        assert format_of(None, [entry]) == "2.12"
