"""tools/plan_report.py on a tiny bundle: calibration and proof, each by its command."""

import json
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.writer import write_bundle
from camkit.errors import ContractError
from camkit.runtime.plan.loss import read_loss_model
from tests.bundle_factory import tiny_manifest, tiny_members, tiny_stages
from tests.plan_factory import half_textured_mosaic, write_planned_bundle
from tests.tiny_design import run_tool


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_planned_bundle(tmp_path_factory.mktemp("planned"))


@pytest.fixture
def tool(monkeypatch: pytest.MonkeyPatch) -> Callable[..., int]:
    """Run the tool in this process."""
    return partial(run_tool, monkeypatch, "plan_report")


def test_calibrate_writes_one_plan_into_a_file_and_into_a_bundle(
    bundle: Bundle, tool: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "pictures"
    folder.mkdir()
    for number in range(2):
        grey = np.roll(half_textured_mosaic(), 300 * number, axis=1) // 4
        cv2.imwrite(str(folder / f"{number}.png"), grey.astype(np.uint8))
    target = tmp_path / "target.camkit"
    shutil.copy(bundle.path, target)
    code = tool(
        *("calibrate", "--bundle", bundle.path, "--data", folder, "--pictures", 2),
        *("--procedural", 0, "--out", tmp_path / "new" / "plan.json", "--write", target),
    )
    assert code == 0
    out, err = capsys.readouterr()
    assert "2 captures, 24 cells" in out
    assert "0.png ISO 100" in err
    written = open_bundle(target)
    assert written.manifest.plan is not None
    stored = {name: entry.model_dump() for name, entry in written.manifest.plan.items()}
    assert stored == json.loads((tmp_path / "new" / "plan.json").read_text(encoding="utf-8"))
    assert written.manifest.plan != bundle.manifest.plan
    model = read_loss_model(written.manifest.plan)
    assert model is not None
    assert set(model.lines) == {"exact", "plain", "wiener", "S"}
    assert {n: written.member(n) for n in written.names} == {
        n: bundle.member(n) for n in bundle.names
    }


def test_a_camera_without_a_network_is_refused_before_any_work(
    tool: Callable[..., int], tmp_path: Path
) -> None:
    manifest = tiny_manifest(stages=tiny_stages("network"), networks={})
    members = {n: d for n, d in tiny_members().items() if n != "network_m.onnx"}
    write_bundle(tmp_path / "plain.camkit", manifest, members)
    with pytest.raises(ContractError, match="tiny has none"):
        tool("calibrate", "--bundle", tmp_path / "plain.camkit")


def test_report_proves_the_scenes_asked_for(
    bundle: Bundle, tool: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code = tool(
        *("report", "--bundle", bundle.path, "--kinds", "text", "--limit", 1, "--runs", 1),
        *("--width", 640, "--height", 512, "--out-dir", tmp_path),
    )
    assert code == 0
    first, *table = capsys.readouterr().out.splitlines()
    assert first.startswith("text     text:")
    assert [line.split("|")[1].strip() for line in table[2:]] == ["text", "all"]
    record = json.loads((tmp_path / "plan.json").read_text(encoding="utf-8"))
    assert [row["kind"] for row in record["rows"]] == ["text"]
