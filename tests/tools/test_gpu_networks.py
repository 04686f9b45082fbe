"""Networks rebuilt in torch equal onnxruntime, without camkit where they are measured."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tools import gpu_networks

ALONE = (
    "import sys\n"
    "for name in ('camkit', 'onnx', 'onnxruntime', 'pydantic', 'scipy'): sys.modules[name] = None\n"
    "import runpy\n"
    "sys.argv[:1] = []\n"
    "runpy.run_path(sys.argv[0], run_name='__main__')\n"
)


@pytest.mark.parametrize(
    ("bundle", "width_px", "height_px"),
    [("duet", 64, 48), ("streak-hdr", 64, 48), ("spad-sr", 16, 8)],
)
def test_every_kind_of_network_equals_onnxruntime_where_neither_it_nor_camkit_is(
    bundle: str, width_px: int, height_px: int, tmp_path: Path
) -> None:
    gpu_networks.prepare(tmp_path, [bundle])
    out = tmp_path / "report.json"
    words = (
        *("measure", str(tmp_path), "-o", str(out), "--device", "cpu", "--seconds", "0"),
        *("--width", str(width_px), "--height", str(height_px), "--tile", "32"),
    )
    if bundle == "duet":  # once: a start takes two seconds
        command = [sys.executable, "-c", ALONE, gpu_networks.__file__, *words]
        subprocess.run(command, check=True, capture_output=True)
    else:
        assert gpu_networks.main(list(words)) == 0
    report = json.loads(out.read_text())
    assert report["device"] == "cpu"
    assert report["left_out"] == []
    for row in report["networks"]:
        assert row["parity_max_abs"] <= gpu_networks.PARITY
        assert row["tiles_max_abs"] <= gpu_networks.PARITY
        assert 0 < row["fp16_max_abs"] < 0.1
        assert set(row["latency"]) == {"fp32 nchw", "fp32 nhwc", "fp16 nchw", "fp16 nhwc"}


def test_networks_beyond_the_time_are_named(tmp_path: Path) -> None:
    gpu_networks.prepare(tmp_path, ["duet"])
    out = tmp_path / "report.json"
    words = ["measure", str(tmp_path), "-o", str(out), "--device", "cpu", "--minutes", "0"]
    assert gpu_networks.main(words) == 0
    assert json.loads(out.read_text())["left_out"] == ["duet/restore/S", "duet/restore/M"]
