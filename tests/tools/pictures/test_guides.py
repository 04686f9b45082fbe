"""Pictures of guides show what their pages say."""

import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import camkit
from camkit.bundle.manifest import LIGHT_VERSION
from camkit.bundle.reader import Bundle, open_bundle
from camkit.runtime.proof.laws.darkroom import Exposed
from tests.bundle_factory import write_tiny_bundle
from tests.hdr_bundle import write_hdr_bundle
from tools.pictures import guides
from tools.pictures.portable_chain import DATA, GRAPHS

DOCS = Path(__file__).parents[3] / "docs"


@dataclass(frozen=True, kw_only=True)
class Room:
    """A darkroom whose network darkens lamps where no bound holds it."""

    bundle: Bundle
    size: str
    threads: int
    isos = (100.0, 6400.0)

    def expose(self, scene: Any, _place: str, _settings: Sequence[Any]) -> Iterator[Exposed]:
        is_bound = self.bundle.manifest.version_pair >= LIGHT_VERSION
        made = scene if is_bound else np.minimum(scene, np.float32(0.1))
        yield Exposed(truth=scene, network=made, front=scene, light=made, front_light=scene)


@pytest.fixture
def sheets(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Return the rows of every sheet that is written."""
    rows: list[Any] = []
    monkeypatch.setattr(guides, "write_captioned", lambda *words: rows.append(words[-1]))
    return rows


def test_lamps_are_dark_without_the_bound_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sheets: list[Any]
) -> None:
    bundle = open_bundle(write_tiny_bundle(tmp_path))
    old = replace(bundle, manifest=bundle.manifest.model_copy(update={"format_version": "2.5"}))
    monkeypatch.setattr(guides, "open_bundle", lambda _: old)
    monkeypatch.setattr(guides, "Darkroom", Room)
    guides.write_lamps(tmp_path / "laws.jpg", tmp_path)
    ((columns,),) = (sheet.values() for sheet in sheets)
    assert list(columns) == ["no bound: 100% too dark", "bound: 0% too dark", "truth"]
    free, bound, truth = columns.values()
    np.testing.assert_array_equal(bound, truth)
    assert free.max() < truth.max()


def test_a_clone_without_the_older_bundle_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(guides, "OLD_BUNDLE", "HEAD:no/such.camkit")
    with pytest.raises(SystemExit, match="whole history"):
        guides.write_law(tmp_path / "laws.jpg", tmp_path)


def test_a_bracket_loses_lamps_that_one_exposure_keeps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sheets: list[Any]
) -> None:
    path = write_hdr_bundle(tmp_path).path
    monkeypatch.setattr(guides, "find_bundle", lambda _: path)
    monkeypatch.setattr(camkit, "load", lambda _, load=camkit.load: load(path))
    monkeypatch.setattr(guides, "NIGHT_PX", 128)
    monkeypatch.setattr(guides, "NIGHT_CROP", np.s_[:, 32:96, 32:96])
    monkeypatch.setattr(guides, "MOVING", (((60.0, 56.0), (0.0, 10.0), 4.0, 100.0),))
    guides.write_moving_lamps(tmp_path / "lamps.jpg", tmp_path)
    (rows,) = sheets
    for title, columns in rows.items():
        bracket, once, truth = (picture[:, 26:31, 22:27].mean() for picture in columns.values())
        assert bracket < 0.8 * truth, title
        assert abs(once - truth) < 0.2 * truth, title


def test_the_command_draws_the_scan_of_its_page_and_the_chain(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    names = ["photons-depth.png", "portable-chain.png"]
    monkeypatch.setattr(sys, "argv", ["guides", "-o", str(tmp_path), *names])
    guides.main()
    assert capsys.readouterr().out.count(" kB") == len(names)
    for name in names:
        drawn = cv2.imread(str(tmp_path / name))
        shown = cv2.imread(str(DOCS / "images" / name))
        assert drawn is not None
        assert shown is not None
        assert drawn.shape == shown.shape
        assert np.mean(np.abs(drawn.astype(int) - shown)) < 2
    page = (DOCS / "start" / "photons.md").read_text(encoding="utf-8")
    assert "(abs(x - 128) < 50) & (abs(y - 64) < 30)" in page
    assert f"np.where(box, {guides.BOX_M:.2f}, {guides.WALL_M:.2f})" in page
    assert f"--photons {guides.DEPTH_PHOTONS.photons} --sbr {guides.DEPTH_PHOTONS.sbr}" in page


def test_every_graph_of_the_chain_is_one_of_its_page() -> None:
    page = (DOCS / "guides" / "portable.md").read_text(encoding="utf-8")
    files = set(re.findall(r"`(\w+)\.onnx`", page))
    stems = {name.rstrip("*") for name in GRAPHS}
    assert all(any(file.startswith(stem) for stem in stems) for file in files)
    assert all(any(file.startswith(stem) for file in files) for stem in stems)
    assert {target for graph in GRAPHS.values() for target in graph.gives} <= GRAPHS.keys()
    assert all(shape in page for *_, shape in DATA)
