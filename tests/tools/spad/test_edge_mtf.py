"""Figure 4.9 on small arrays: what needs no network is known, and wrong networks are refused."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camkit.models_def.kinds.spad.plate_psf import read_plate_psf
from tests.one_thread import one_thread  # noqa: F401
from tests.spad_checkpoint import tiny_recipe, write_untrained
from tools.spad import edge_mtf
from tools.spad.edge_mtf import CYCLES_PER_PX, PLATE, SLOPES, Row, main

TOLERANCE = 0.02
"""A hundredth of the measurement, and as much for samples that are four sub-pixels apart."""
RECIPE = tiny_recipe('mode = "low_fill"')


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Arrays of 80 pixels a side, and few crops to fit to."""
    sizes = {"SIDE_PX": 384, "CUT_PX": 32, "FIT_CROPS": 4, "FIT_PX": 64}
    for name, value in sizes.items():
        monkeypatch.setattr(edge_mtf, name, value)


@pytest.fixture
def checkpoint(tmp_path: Path) -> Path:
    """Give an untrained network behind an array without a plate."""
    return write_untrained(tmp_path / "untrained.pt", RECIPE)


def rows_of(folder: Path) -> dict[tuple[str, str, float | None], dict[str, Any]]:
    report = json.loads((folder / "edge-mtf.json").read_text("utf-8"))
    assert report["cycles_per_px"] == CYCLES_PER_PX.round(4).tolist()
    return {(row["sampling"], row["method"], row["photons"]): row for row in report["rows"]}


def plate_otf() -> np.ndarray:
    """Give the mean |OTF| of the shipped plate across the edges."""
    kernel = read_plate_psf(PLATE)
    y, x = np.mgrid[: kernel.shape[0], : kernel.shape[1]] - kernel.shape[0] // 2
    curves = []
    for slope in SLOPES:
        angle = math.atan(slope)
        for along, across in ((x, y), (y, x)):
            far = along * math.cos(angle) - across * math.sin(angle)
            waves = np.exp(-2j * np.pi * np.multiply.outer(CYCLES_PER_PX, far))
            curves.append(np.abs((waves * kernel).sum((1, 2))))
    return np.asarray(np.mean(curves, axis=0))


def test_the_array_has_the_mtf_of_its_pixels_and_of_the_plate(
    tmp_path: Path, checkpoint: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["--low-fill", str(checkpoint), "--photons", "inf", "--out-dir", str(tmp_path)])
    rows = rows_of(tmp_path)
    assert list(rows) == [
        ("ideal", "ideal", None),
        *(("low_fill", name, None) for name in ("array", "bicubic", "linear", "network")),
        *(("learned", name, None) for name in ("array", "bicubic", "linear")),
    ]
    ideal = np.array(rows["ideal", "ideal", None]["mtf"])
    np.testing.assert_allclose(ideal, np.sinc(CYCLES_PER_PX), rtol=0, atol=TOLERANCE)
    bare = np.array(rows["low_fill", "array", None]["mtf"])
    inside = CYCLES_PER_PX <= 0.5
    np.testing.assert_allclose(bare[inside], ideal[inside], rtol=0, atol=TOLERANCE)
    behind = np.array(rows["learned", "array", None]["mtf"])
    expected = (ideal * plate_otf())[inside]
    np.testing.assert_allclose(behind[inside], expected, rtol=0, atol=TOLERANCE)
    assert rows["low_fill", "bicubic", None]["largest"] < 1.01
    assert (tmp_path / "edge-mtf.png").read_bytes().startswith(b"\x89PNG")
    assert capsys.readouterr().out.count("\n") == 10


def test_a_level_of_light_has_noise_and_rows_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(edge_mtf, "EDGES", edge_mtf.EDGES[:2])
    main(["--photons", "1e5", "--draws", "2", "--out-dir", str(tmp_path)])
    rows = rows_of(tmp_path)
    assert {level for _, _, level in rows} == {None, 1e5}
    # cubic interpolation behind no plate, as without noise
    bicubic = rows["low_fill", "bicubic", 1e5]
    assert bicubic["mtf_array_nyquist"] == pytest.approx(0.488, abs=TOLERANCE)


def test_a_network_of_another_sampling_is_refused(checkpoint: Path, tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match=r"must be a network behind learned; .* behind low_fill"):
        main(["--learned", str(checkpoint), "--out-dir", str(tmp_path / "none")])
    assert not (tmp_path / "none").exists()


def test_a_tenth_is_found_between_frequencies() -> None:
    falling = np.exp(-5 * CYCLES_PER_PX)
    curves = np.stack([falling, falling])
    row = Row(sampling="learned", method="network", photons=math.inf, curves=curves)
    assert row.tenth == pytest.approx(math.log(10) / 5, abs=1e-3)
    never = Row(sampling="learned", method="network", photons=1e4, curves=0 * curves + 1.02)
    assert never.tenth == 1
    assert (never.largest(mean=True), never.entry()["photons"]) == (1.02, 1e4)
