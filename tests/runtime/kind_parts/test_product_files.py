"""Captures that are no photographs: a package brings stages and products, ordinary commands run.

The kind is `tests/counting_camera`, installed as somebody else's package would be.
"""

import json
import pickle
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import camkit
from camkit import kinds
from camkit.errors import ContractError, DecodeError
from camkit.kinds import BAYER, find_kind, kind_of_file
from camkit.runtime.batch import expand
from camkit.runtime.kind import kind_without_bundle
from camkit.runtime.options import Options, with_absolute_files, with_choices
from tests.installed_package import ROOT, installed


@pytest.fixture(autouse=True, scope="module")
def counting_installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    points = {kinds.GROUP: {"counting": "tests.counting_camera:KIND", "broken": "nowhere:KIND"}}
    with installed(tmp_path_factory.mktemp("site"), "counting-camera", points):
        yield


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    path = tmp_path / "in" / "shot.counts"
    path.parent.mkdir()
    path.write_text("1 2 3", encoding="utf-8")
    return path


def _run(*arguments: object) -> int:
    from camkit.cli.app import run

    return run([str(argument) for argument in arguments])


def _sidecar(folder: Path) -> dict[str, Any]:
    return dict(json.loads((folder / "shot.camkit.json").read_text(encoding="utf-8")))


def test_products_and_sidecar_appear_together(capture: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    (result,) = camkit.process(capture, bundle="none", out_dir=out)
    assert result.status == "ok"
    assert result.output == out / "shot.npz"
    assert result.beside == (out / "shot.txt",)
    assert np.load(out / "shot.npz")["sums"].tolist() == [1, 3, 6]
    assert {path.name for path in out.iterdir()} == {"shot.npz", "shot.txt", "shot.camkit.json"}
    record = _sidecar(out)
    assert record["counts"] == {"last": 6}
    assert record["plan"] == {"factor": 1}
    assert record["clipped_fraction"] is None


def test_a_format_adds_its_picture(capture: Path, tmp_path: Path) -> None:
    (result,) = camkit.process(capture, bundle="none", out_dir=tmp_path, format="tiff")
    assert [path.suffix for path in result.beside] == [".txt", ".tif"]
    with pytest.raises(ContractError, match="format must be one of tiff for such captures"):
        camkit.process(capture, bundle="none", out_dir=tmp_path / "b", format="png")


def test_products_in_memory_are_the_same(capture: Path) -> None:
    pipeline = camkit.load(None, kind="counting", sign="minus")
    assert pipeline.make(capture).arrays["sums"].tolist() == [-1, -3, -6]
    again = pickle.loads(pickle.dumps(pipeline))
    assert again.make(capture).arrays["sums"].tolist() == [-1, -3, -6]
    assert camkit.load(None, sign="plus").kind.name == "counting"
    with pytest.raises(ContractError, match="no picture as png; format may be: tiff"):
        pipeline.make(capture).files("png")


def test_products_are_no_picture(capture: Path) -> None:
    pipeline = camkit.load(None, kind="counting")
    with pytest.raises(
        ContractError,
        match=r"this capture gives sums, not an image; `run` returns them, in `arrays`",
    ):
        _ = pipeline.process(capture).image
    with pytest.raises(ContractError, match="out is filled with a picture"):
        pipeline.run(capture, out=np.zeros((3, 4, 5), np.float32))
    with pytest.raises(ContractError, match="no product 'depth_m'; there are sums"):
        pipeline.run(capture, products=["depth_m"])
    with pytest.raises(ContractError, match="origin_px does not apply to captures of the kind cou"):
        pipeline.run(capture, origin_px=(0, 0))
    with pytest.raises(ContractError, match="leave kind out"):
        camkit.load("duet", kind="counting")


def test_the_kind_is_known_by_option_then_by_file() -> None:
    assert kind_of_file(Path("a.COUNTS")) is find_kind("counting")
    assert kind_of_file(Path("a.tif")) is None
    assert kind_without_bundle(Path("a.tif"), Options()) is BAYER
    options = Options(of_kind=(("sign", "plus"),))
    assert kind_without_bundle(Path("a.tif"), options).name == "counting"
    assert kind_without_bundle(Path("a.counts"), Options()).name == "counting"


def test_a_folder_stands_for_the_captures_of_the_kind(capture: Path, tmp_path: Path) -> None:
    stack = capture.with_name("stack.tif")
    stack.write_text("4 5", encoding="utf-8")
    capture.with_name("photo.png").write_bytes(b"")
    kind = find_kind("counting")
    assert [path.name for path in expand([capture.parent], kind)] == ["shot.counts", "stack.tif"]
    assert [path.name for path in expand([capture.parent], BAYER)] == ["photo.png", "stack.tif"]
    results = camkit.process(capture.parent, bundle="none", out_dir=capture.parent, sign="plus")
    assert [result.status for result in results] == ["ok", "ok"]
    # what was made there is not taken for captures
    assert [path.name for path in expand([capture.parent], kind)] == ["shot.counts", "stack.tif"]


def test_what_means_nothing_is_refused(capture: Path, tmp_path: Path) -> None:
    with pytest.raises(ContractError, match="exposure_ev does not apply to captures of the kind"):
        camkit.load(None, kind="counting", exposure_ev=1.0)
    with pytest.raises(ContractError, match="method must be one of running"):
        camkit.load(None, kind="counting", method="wiener")
    with pytest.raises(ContractError, match="sign must be one of plus, minus; got 'both'"):
        camkit.load(None, sign="both")
    with pytest.raises(ContractError, match="sign does not apply to bundle duet: it is for cam"):
        camkit.load("duet", sign="plus")
    with pytest.raises(ContractError, match=r"unknown option.*colour.*known are.*sign.*weights"):
        camkit.load(None, colour="red")
    with pytest.raises(ContractError, match="no kind of camera has an option 'zeal'"):
        Options(of_kind=(("zeal", "1"),))
    with pytest.raises(ContractError, match=r"unknown option.*colour"):
        camkit.process(capture, bundle="none", out_dir=tmp_path, colour="red")


def test_a_file_that_an_option_names_counts_by_its_content(capture: Path, tmp_path: Path) -> None:
    weights, out = tmp_path / "weights.txt", tmp_path / "out"
    weights.write_text("2", encoding="utf-8")

    def status() -> str:
        return camkit.process(capture, bundle="none", out_dir=out, weights=weights, resume=True)[
            0
        ].status

    assert status() == "ok"
    assert np.load(out / "shot.npz")["sums"].tolist() == [2, 6, 12]
    assert status() == "skipped"
    weights.write_text("3", encoding="utf-8")
    assert status() == "ok"
    assert np.load(out / "shot.npz")["sums"].tolist() == [3, 9, 18]


def test_a_product_that_was_changed_is_made_again(capture: Path, tmp_path: Path) -> None:
    def status() -> str:
        return camkit.process(capture, bundle="none", out_dir=tmp_path, resume=True)[0].status

    assert [status(), status()] == ["ok", "skipped"]
    (tmp_path / "shot.txt").write_text("7\n", encoding="utf-8")
    assert [status(), status()] == ["ok", "skipped"]
    (tmp_path / "shot.txt").unlink()
    assert [status(), status()] == ["ok", "skipped"]


def test_nothing_that_is_there_is_replaced_unasked(capture: Path, tmp_path: Path) -> None:
    note = tmp_path / "shot.txt"
    note.write_text("mine\n", encoding="utf-8")
    with pytest.raises(ContractError, match=r"1 output.s. exist .*shot.txt"):
        camkit.process(capture, bundle="none", out_dir=tmp_path)
    assert note.read_text(encoding="utf-8") == "mine\n"
    camkit.process(capture, bundle="none", out_dir=tmp_path, overwrite=True)
    assert note.read_text(encoding="utf-8") == "6\n"


def test_a_capture_is_never_its_own_product(tmp_path: Path) -> None:
    stack = tmp_path / "stack.tif"
    stack.write_text("4 5", encoding="utf-8")
    with pytest.raises(ContractError, match="would overwrite itself"):
        camkit.process(stack, bundle="none", out_dir=tmp_path, sign="plus", format="tiff")
    assert stack.read_text(encoding="utf-8") == "4 5"


def test_two_captures_may_not_share_a_file_beside(capture: Path, tmp_path: Path) -> None:
    other = tmp_path / "shot.counts"
    other.write_text("9", encoding="utf-8")
    with pytest.raises(ContractError, match="would both give"):
        camkit.process([capture, other], bundle="none", out_dir=tmp_path / "out")


def test_a_bad_capture_stops_no_other(capture: Path, tmp_path: Path) -> None:
    bad = capture.with_name("bad.counts")
    bad.write_text("1 two", encoding="utf-8")
    results = camkit.process([bad, capture], bundle="none", out_dir=tmp_path / "out")
    assert [result.status for result in results] == ["failed", "ok"]
    assert "bad.counts holds no counts" in str(results[0].error)
    assert not (tmp_path / "out" / "bad.npz").exists()
    with pytest.raises(DecodeError):
        camkit.load(None, kind="counting").make(bad)


def test_the_command_line_has_the_options_of_the_kind(
    capture: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: Any
) -> None:
    import subprocess
    import sys

    def camkit_run(*arguments: object) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "camkit", *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)

    out = tmp_path / "out"
    common = (capture, "--bundle", "none", "--sign", "minus", "--out-dir", out)
    planned = camkit_run("plan", *common)
    assert planned.returncode == 0, planned.stderr
    assert "sum: running (asked)" in planned.stdout
    told = camkit_run("process", *common, "--json")
    assert told.returncode == 0, told.stderr
    assert json.loads(told.stdout)["beside"] == [str(out / "shot.txt")]
    assert np.load(out / "shot.npz")["sums"].tolist() == [-1, -3, -6]
    refused = camkit_run("process", *common, "--sign", "both", "--overwrite")
    assert refused.returncode == 2
    assert "sign must be one of plus, minus" in refused.stderr
    assert "Which counts (counting: plus, minus)." in " ".join(
        camkit_run("process", "--help").stdout.replace("│", " ").split()
    )


def test_names_of_files_are_absolute_for_other_processes() -> None:
    options = with_choices(Options(), {"weights": "w.txt", "sign": "plus"})
    found = dict(with_absolute_files(options).of_kind)
    assert found == {"weights": str(Path("w.txt").absolute()), "sign": "plus"}
