"""`camkit doctor`: facts about this machine, and a decoder that was tried."""

import json
import tomllib
from importlib import util
from pathlib import Path

import pytest

from camkit import __version__
from camkit.bundle import reader
from camkit.cli.judge.doctor import PURPOSES, ready_for
from camkit.errors import BundleError, DecodeError, UnsupportedError
from camkit.report.analysis.subject import find_subject
from camkit.report.bench import machine
from camkit.report.judge_need import require_judge
from tests.bundle_factory import write_tiny_bundle

SETTINGS = Path(__file__).resolve().parents[4] / "pyproject.toml"


def test_doctor_tells_versions_and_tries_the_decoder(camkit_command) -> None:
    outcome = camkit_command("doctor", "--json")
    facts = json.loads(outcome.out)
    assert outcome.code == 0
    assert facts["raw_decoder"] == "works"
    assert facts["threads"] >= 1
    assert facts["memory_mb"] > 100
    assert "CPUExecutionProvider" in facts["providers"]
    assert facts["packages"]["numpy"][0].isdigit()
    assert "bf16" in facts["openvino"]
    assert facts["ready_for"]["charts, pages and scores of pictures"] == "ready"


def test_doctor_says_what_is_missing_for_what(monkeypatch) -> None:
    project = tomllib.loads(SETTINGS.read_text(encoding="utf-8"))["project"]
    assert {extra for extra, _ in PURPOSES.values()} <= project["optional-dependencies"].keys()
    monkeypatch.setattr(util, "find_spec", lambda _: None)
    monkeypatch.setattr(reader, "BUNDLES", "camkit.bundles")
    states = ready_for()
    assert states.pop("pictures of captures") == "ready"
    extras = {
        purpose: f"not installed: pip install 'camkit[{e}]'" for purpose, (e, _) in PURPOSES.items()
    }
    assert states == extras
    with pytest.raises(UnsupportedError, match=r"matplotlib and scikit-image; .*camkit\[judge\]"):
        require_judge()


def test_cameras_of_the_other_package_are_found_or_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A wheel of camkit holds one camera; the rest come with camkit-bundles."""
    own, more = tmp_path / "own_bundles", tmp_path / "more_bundles"
    for folder, name in ((own, "duet"), (more, "tiny")):
        folder.mkdir()
        (folder / "__init__.py").touch()
        write_tiny_bundle(folder, f"{name}.camkit")
    (own / "bundles.toml").write_text("duet = {}\ntiny = {}\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(reader, "BUNDLES", "own_bundles")
    monkeypatch.setattr(reader, "MORE_BUNDLES", "absent_bundles")
    with pytest.raises(BundleError, match="tiny is not installed: pip install camkit-bundles"):
        reader.find_bundle("tiny")
    assert ready_for()["the cameras tiny"].endswith(f"camkit-bundles=={__version__}")
    with pytest.raises(BundleError, match="did you mean tiny"):
        reader.find_bundle("tinny")
    with pytest.raises(BundleError, match="tiny is not installed"):
        find_subject("tiny")  # no lens of that name stands for it
    monkeypatch.setattr(reader, "MORE_BUNDLES", "more_bundles")
    assert reader.find_bundle("tiny") == more / "tiny.camkit"
    assert not reader.missing_bundles()


def test_cameras_of_another_version_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pip alone would find camkit-bundles installed already."""
    monkeypatch.setattr(machine, "package_version", lambda _: "0.1.0")
    state = ready_for()["the cameras of camkit-bundles"]
    assert state.startswith(f"of camkit 0.1.0, this is {__version__}: pip install camkit-bundles==")
    monkeypatch.setattr(machine, "package_version", lambda _: __version__)
    assert "the cameras of camkit-bundles" not in ready_for()


def test_doctor_says_when_the_decoder_fails(camkit_command, monkeypatch) -> None:
    def broken(path: object) -> None:
        raise DecodeError("no LibRaw here")

    monkeypatch.setattr("camkit.runtime.raw.read_capture", broken)
    outcome = camkit_command("doctor")
    assert outcome.code == 0
    assert "raw_decoder: fails: no LibRaw here" in outcome.out
    assert "  numpy: " in outcome.out
