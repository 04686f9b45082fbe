"""Networks of others in a camera: proved, refused by their reason, exact on any crop and tile."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from numpy.typing import NDArray

import camkit
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.stages import Network
from camkit.errors import ContractError, ParityError, UnsupportedError
from camkit.export.foreign.adding import bundle_with_network
from camkit.export.foreign.contract import to_contract
from camkit.export.foreign.onnx_file import foreign_model
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.proof.check import check_bundle
from camkit.runtime.proof.golden_run import case_work
from tests.bundle_factory import write_tiny_bundle
from tests.foreign_networks import DnCNN, Mdta, NAFNet, NormedUnet, Sid, exported, seeded

SRGB: dict[str, Any] = {"planes": "rgb", "space": "srgb"}
PACKED: dict[str, Any] = {
    "planes": "packed",
    "space": "camera-linear",
    "order": ["R", "G1", "B", "G2"],
}


@cache
def _data(network: type, channels: int = 3) -> bytes:
    return exported(seeded(network), "legacy", channels=channels, opset=17)


def _added(
    folder: Path, network: type, given: dict[str, Any], channels: int = 3, **tables: Any
) -> tuple[Bundle, dict[str, Any]]:
    camera = open_bundle(write_tiny_bundle(folder))
    model = foreign_model(onnx.load_from_string(_data(network, channels)))
    contract = to_contract({"input": given} | tables)
    report = bundle_with_network(model, contract, camera, folder / "mine.camkit")
    return open_bundle(folder / "mine.camkit"), report


def test_a_residual_network_in_srgb_is_added_and_proved(tmp_path: Path) -> None:
    bundle, report = _added(tmp_path, DnCNN, SRGB, output={"residual": "subtracted"})
    assert bundle.manifest.format_version == "2.11"
    assert [s.type for s in bundle.manifest.stages if s.type in ("wiener", "network")] == [
        "network"
    ]
    assert check_bundle(bundle.path, run=case_work, left_out=("laws",)).passed
    assert report["canonical_difference"] <= 1e-5
    assert any("no pairs of your own script" in text for text in report["warnings"])


def test_a_network_on_a_packed_mosaic_gives_the_same_on_crops_of_every_phase(
    tmp_path: Path,
) -> None:
    bundle, _ = _added(tmp_path, Sid, PACKED, channels=4, output={"space": "srgb"})
    types = [stage.type for stage in bundle.manifest.stages]
    assert types[3:6] == ["pack", "network", "unpack"]
    assert "demosaic" not in types
    rng = np.random.default_rng(4)
    mosaic = rng.integers(64, 900, (64, 96), dtype=np.uint16)
    pipeline = Pipeline(bundle, Options(threads=1))

    def clean(x: int, y: int) -> NDArray[np.float32]:
        capture = pipeline.capture_of(
            np.ascontiguousarray(mosaic[y:, x:]),
            iso=100,
            white_balance=(2.0, 1.0, 1.5),
            origin_px=(x, y),
        )
        rows = pipeline.start(capture).rows_of("whole")
        return rows.read(0, rows.shape[1])

    whole = clean(0, 0)
    assert whole.shape == (3, 64, 96)
    for x, y in ((1, 0), (0, 1), (1, 1)):
        part, margin = clean(x, y), 20
        inside = np.s_[:, margin : 44 - y, margin : 72 - x]
        moved = np.s_[:, margin + y : 44, margin + x : 72]
        np.testing.assert_array_equal(part[inside], whole[moved])


def test_a_network_that_looks_at_the_whole_picture_is_refused_without_a_mode(
    tmp_path: Path,
) -> None:
    with pytest.raises(ContractError, match=r'looks at the whole picture .*5 in all.*"constants"'):
        _added(tmp_path, NAFNet, SRGB)
    assert not (tmp_path / "mine.camkit").exists()


def test_frozen_statistics_state_their_cost(tmp_path: Path) -> None:
    tables = {"global": {"mode": "constants"}}
    bundle, report = _added(tmp_path, NormedUnet, SRGB | {"range": [-1, 1]}, **tables)
    assert not bundle.network_facts("restore", "M").global_operators
    cost = report["db_whole"] - report["db_changed"]
    assert report["statistics_cost_db"] == pytest.approx(cost, abs=2e-3)


def test_one_window_is_admitted_where_the_sensor_fits(tmp_path: Path) -> None:
    bundle, report = _added(tmp_path, NormedUnet, SRGB, **{"global": {"mode": "whole"}})
    assert bundle.network_facts("restore", "M").global_operators
    assert "one window holds the 96x64 px" in report["global_mode"]


def test_a_map_of_the_noise_lies_behind_the_planes(tmp_path: Path) -> None:
    class Noted(DnCNN):
        def __init__(self) -> None:
            super().__init__(channels=4)
            self[-1] = type(self[-1])(8, 3, 3, padding=1)

    bundle, _ = _added(tmp_path, Noted, SRGB | {"noise": "map"}, channels=4)
    (stage,) = bundle.manifest.stages_of(Network)
    assert stage.takes_noise
    case = bundle.manifest.golden[0]
    from camkit.bundle.golden import golden_from_bytes

    arrays = golden_from_bytes(bundle.member("golden.safetensors"))[case.name]
    planes = case_work(bundle, case, arrays, "M").network_input("restore")
    assert planes.shape[0] == 4
    assert (planes[3] > 0).all()


def test_attention_is_refused_by_all_of_its_operators(tmp_path: Path) -> None:
    with pytest.raises(UnsupportedError, match=r"Reshape.*MatMul"):
        _added(tmp_path, Mdta, SRGB)


def test_channels_and_scale_that_contradict_the_contract_are_named_together(
    tmp_path: Path,
) -> None:
    tables = {"output": {"scale": 2, "residual": "added"}}
    with pytest.raises(ContractError) as caught:
        _added(tmp_path, Sid, SRGB, channels=4, **tables)
    text = str(caught.value)
    assert "takes 4 channels; planes of the contract have 3" in text
    assert "a residual has the 3 channel(s) and the grid of its last plane" in text


def test_a_name_that_no_camera_may_have_is_refused_before_work(tmp_path: Path) -> None:
    camera = open_bundle(write_tiny_bundle(tmp_path))
    model = foreign_model(onnx.load_from_string(_data(DnCNN)))
    with pytest.raises(ContractError, match="name must read like my-camera_2; got 'My Camera'"):
        bundle_with_network(model, to_contract({"input": SRGB}), camera, tmp_path / "My Camera")


def test_wrong_pairs_stop_the_work_before_a_bundle(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    arrays = {key: rng.random((3, 32, 32)).astype(np.float32) for key in ("input", "output")}
    np.savez(tmp_path / "io.npz", **arrays)
    (tmp_path / "net.onnx").write_bytes(_data(DnCNN))
    write_tiny_bundle(tmp_path)
    with pytest.raises(ParityError, match="the owner's pairs differ by"):
        camkit.export.add_network(
            tmp_path / "net.onnx",
            tmp_path / "mine.camkit",
            contract={"input": SRGB},
            camera=tmp_path / "tiny.camkit",
            pairs=tmp_path / "io.npz",
        )
    assert not (tmp_path / "mine.camkit").exists()


def test_tiles_of_a_coded_network_have_the_bits_of_the_whole(tmp_path: Path) -> None:
    bundle, _ = _added(tmp_path, Sid, PACKED, channels=4, output={"space": "srgb"})
    rng = np.random.default_rng(5)
    mosaic = rng.integers(64, 900, (64, 96), dtype=np.uint16)
    pictures, fits = [], Options(threads=1)
    for options in (fits, replace(fits, threads=2, tile_px=8), replace(fits, tile_px=20)):
        pipeline = Pipeline(bundle, options)
        capture = pipeline.capture_of(mosaic, iso=100, white_balance=None, origin_px=None)
        rows = pipeline.start(capture).rows_of("whole")
        pictures.append(rows.read(0, rows.shape[1]))
    assert pictures[0].shape == (3, 64, 96)
    for other in pictures[1:]:
        np.testing.assert_array_equal(other, pictures[0])
