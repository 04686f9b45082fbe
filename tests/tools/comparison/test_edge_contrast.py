"""The contrast that methods leave of slanted edges, on a tiny bundle."""

import json
from pathlib import Path

import numpy as np
import pytest

from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from tests.wide_bundle import write_wide_bundle
from tools.comparison import edge_contrast


@pytest.fixture(autouse=True)
def small_edges(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in {"SIDE_PX": 160, "SEEN_PX": 128, "FIELD_SHARES": (0.0,)}.items():
        monkeypatch.setattr(edge_contrast, name, value)


def test_every_method_gets_its_curves_and_extremes(tmp_path: Path) -> None:
    bundle = write_wide_bundle(tmp_path)
    out = tmp_path / "found" / "edges.json"
    edge_contrast.main([str(bundle.path), "--levels", "0.2", "0.6", "--draws", "1", "-o", str(out)])
    found = json.loads(out.read_text(encoding="utf-8"))
    assert [row["method"] for row in found["rows"]] == ["wiener", *bundle.manifest.sizes]
    for row in found["rows"]:
        curves = np.array(list(row["contrast"].values()))
        assert curves.shape == (2, 1, len(found["cycles_per_px"]))
        assert row["largest"] == curves.max()
        assert 0 <= row["rise"] < row["largest"]


def test_a_sharp_edge_keeps_its_contrast_and_a_doubled_one_doubles_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bundle = write_wide_bundle(tmp_path)
    pipeline = Pipeline(bundle, Options())
    shots = edge_contrast.Shots(levels=(0.2, 0.6), draws=1)
    depth_mm = bundle.psf.depths_mm.tolist()[0]
    for factor in (1, 2):
        monkeypatch.setattr(
            edge_contrast, "_restored", lambda _, simulation, f=factor: f * simulation.clean.mean(0)
        )
        for direction in edge_contrast.DIRECTIONS:
            contrast = edge_contrast._contrasts(bundle, pipeline, direction, depth_mm, shots)
            assert contrast == pytest.approx(factor, abs=0.02)
