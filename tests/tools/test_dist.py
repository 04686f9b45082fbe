"""The trees that packages are built from: what git tracks, each camera in one of the two."""

import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

import camkit
from camkit.bundle.reader import open_bundle
from tools import dist


def test_each_camera_is_in_one_package(tmp_path: Path) -> None:
    product, bundles = tmp_path / "product", tmp_path / "bundles"
    dist.export_product(product)
    dist.export_bundles(bundles)
    held = [sorted(path.stem for path in tree.rglob("*.camkit")) for tree in (product, bundles)]
    listed = tomllib.loads((product / "camkit" / "bundles" / "bundles.toml").read_text())
    assert held[0] == ["duet"]
    assert sorted([*held[0], *held[1]]) == sorted(listed)
    for path in bundles.rglob("*.camkit"):
        assert open_bundle(path).manifest.name == path.stem


def test_packages_are_whole_and_of_one_version(tmp_path: Path) -> None:
    dist.export_product(tmp_path / "product")
    dist.export_bundles(tmp_path / "bundles")
    own, more = (
        tomllib.loads((tmp_path / name / "pyproject.toml").read_text())["project"]
        for name in ("product", "bundles")
    )
    assert own["version"] == more["version"] == camkit.__version__
    assert more["dependencies"] == [f"camkit=={camkit.__version__}"]
    for name in ("product", "bundles"):
        assert {"README.md", "LICENSE"} <= {path.name for path in (tmp_path / name).iterdir()}
    assert not [path for path in tmp_path.rglob("*") if path.is_symlink()]
    assert (tmp_path / "product" / "runtime" / "pipeline.py").is_file()


def test_both_are_built_into_one_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run, built = subprocess.run, []

    def build(command: list[str], **settings: Any) -> Any:
        if "build" not in command:
            return run(command, **settings)
        tree = Path(command[-1])
        assert (tree / "pyproject.toml").is_file()
        Path(command[-2], f"{tree.name}.whl").write_bytes(b"wheel")
        return built.append(tree.name)

    monkeypatch.setattr(subprocess, "run", build)
    monkeypatch.setattr(sys, "argv", ["dist", "-o", str(tmp_path)])
    dist.main()
    assert built == ["product", "bundles"]
    assert "product.whl: 0.0 MB" in capsys.readouterr().out
