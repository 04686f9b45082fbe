"""The networks of other samplings as one bundle, small and proved."""

from pathlib import Path

import numpy as np
import pytest
import torch

from camkit.bundle.reader import open_bundle
from camkit.export.onnx_graph import to_onnx
from camkit.models_def.kinds.spad.networks import build_spad_network
from camkit.models_def.networks.bicubic import Bicubic
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.runtime.kinds.spad.finer.sampling import box_kernel, gaussian_kernel
from camkit.runtime.network.graph import inspect_graph
from tests.tools.tables.spad.array_rig import SIGMA, Rig, rig, write_run
from tools.tables.spad import baselines
from tools.tables.spad.baselines import ROWS_OF_ROLES, main, round_mantissa
from tools.tables.spad.edge_export import PlainBicubic, with_plain_borders

__all__ = ["rig"]
FLOAT32 = 1e-6


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(baselines, "SCENES", 1)
    monkeypatch.setattr(baselines, "WINDOW_PX", (136, 136))


def test_a_bundle_of_baselines_says_how_its_pixels_see(
    rig: Rig, small: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    roles = ("full_fill", "gaussian")
    runs, out = tmp_path / "runs", tmp_path / f"{baselines.BASELINES}.camkit"
    for role in roles:
        write_run(runs, f"{ROWS_OF_ROLES[role]}-1")
    words = ["--runs", str(runs), "-o", str(out), "--roles", *roles]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "pass  tiling" in said
    assert "rounding costs" in said
    bundle = open_bundle(out)
    assert bundle.manifest.name == baselines.BASELINES
    full, gaussian = (FineCamera.of(bundle, role=role) for role in roles)
    assert (full.kernel == box_kernel(11, full.grid)).all()
    assert (gaussian.kernel == gaussian_kernel(11, SIGMA)).all()
    assert FineCamera.of(bundle).stage == full.stage
    for camera in (full, gaussian):
        fine = camera.by_network(np.full((1, 8, 8), 50, np.float32), "M", white=100)
        assert fine.shape == (1, 32, 32)
    with pytest.raises(SystemExit, match="give --overwrite"):
        main(words)


def test_networks_behind_the_plate_are_made_of_what_bundles_admit() -> None:
    network = with_plain_borders(build_spad_network("srcnn", in_channels=2))
    graph = inspect_graph(to_onnx(network, channels=2, scale=4))
    assert graph.receptive_field_radius_px < 10


def test_a_network_that_is_not_trained_is_named(rig: Rig, small: None, tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match=r"low_fill\.M-1 is not trained yet"):
        main(["--runs", str(tmp_path), "-o", str(tmp_path / "out.camkit")])


def test_rounding_leaves_ten_bits_and_moves_no_weight_by_more_than_half_of_the_last() -> None:
    value = torch.randn(1000, generator=torch.Generator().manual_seed(1))
    found = round_mantissa(value, 10)
    assert not (found.numpy().view(np.uint32) & 0x1FFF).any()
    assert float(((found - value) / value).abs().max()) <= 2.0**-11
    whole = torch.tensor([1, 2])
    assert round_mantissa(whole) is whole


def test_plain_bicubic_goes_on_at_borders_as_the_padded_one() -> None:
    samples = torch.randn(1, 2, 5, 9, generator=torch.Generator().manual_seed(2))
    finer = Bicubic()
    assert PlainBicubic(finer, 2)(samples) == pytest.approx(finer(samples), abs=FLOAT32)
