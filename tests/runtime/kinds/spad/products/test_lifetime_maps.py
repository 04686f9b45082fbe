"""Histograms become lifetimes by the ordinary command; what cannot be is refused in one line."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

import camkit
from camkit.cli.app import run
from camkit.errors import ContractError, UnsupportedError
from camkit.runtime.kinds.spad.lifetime.decay import Decay
from camkit.runtime.kinds.spad.pulse import GaussianPulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis

HEIGHT, WIDTH = 10, 14
TIMING = """
[timing]
orientation = "histogram"
time_bin_ps = 100
[lifetime]
period_ps = 12800
from_ps = 500
"""
LASER = "[laser]\nfwhm_ps = 235.48\n"


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    axis = TimeAxis.regular("histogram", bins=128, time_bin_ps=100)
    decay = Decay(axis=axis, pulse=GaussianPulse(sigma_ps=100), period_ps=12_800.0)
    lifetimes = np.repeat(np.linspace(800, 3000, WIDTH)[None], HEIGHT, 0).ravel()
    mean = 3000 * decay.shapes(np.full(len(lifetimes), 2000.0), lifetimes).shares + 0.2
    counts = np.random.default_rng(0).poisson(mean).reshape(HEIGHT, WIDTH, -1)
    counts[3, 4] = 0
    path = tmp_path / "flim.npz"
    np.savez(path, histogram=counts.transpose(2, 0, 1).astype(np.uint16))
    return path


def _timing(folder: Path, text: str) -> Path:
    path = folder / "t.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_scan_becomes_a_map_of_lifetimes(
    scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    timing = _timing(tmp_path, TIMING + LASER)
    arguments = ["process", scan, "--bundle", "none", "--timing", timing, "--out-dir", out]
    arguments += ["--product", "lifetime", "--format", "tiff", "--json"]
    assert run([str(argument) for argument in arguments]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["warnings"] == []
    assert [Path(name).suffix for name in record["beside"]] == [".png", ".tif"]
    found = np.load(out / "flim.npz", allow_pickle=False)
    assert set(found) == {
        *("lifetime_ps", "time_of_flight_ps", "amplitude", "background"),
        *("sigma_ps", "evidence", "intensity", "valid"),
    }
    assert {found[name].shape for name in found} == {(HEIGHT, WIDTH)}
    np.testing.assert_array_equal(np.isnan(found["lifetime_ps"]), ~found["valid"])
    assert not found["valid"][3, 4]
    assert found["valid"].mean() > 0.98
    errors = found["lifetime_ps"] - np.linspace(800, 3000, WIDTH)
    assert np.nanmedian(np.abs(errors / found["sigma_ps"])) == pytest.approx(0.67, abs=0.15)
    assert np.nanmax(np.abs(errors / found["sigma_ps"])) < 4.5
    assert cv2.imread(str(out / "flim.png")) is not None
    sidecar = json.loads((out / "flim.camkit.json").read_text(encoding="utf-8"))
    assert sidecar["plan"]["product"] == "lifetime"
    assert sidecar["plan"]["period_ps"] == 12800


def test_a_pulse_that_nobody_stated_is_found_and_told(scan: Path, tmp_path: Path) -> None:
    timing = _timing(tmp_path, TIMING)
    made = camkit.load(None, kind="spad", timing=timing, product="lifetime").make(scan)
    assert made.record["pulse"]["guessed"]
    assert made.record["pulse"]["fwhm_ps"] == pytest.approx(235, rel=0.15)
    assert "no pulse is stated" in made.warnings[0]
    errors = made.arrays["lifetime_ps"] - np.linspace(800, 3000, WIDTH)
    assert abs(np.nanmedian(errors / made.arrays["sigma_ps"])) < 0.5


def test_what_cannot_be_is_refused(scan: Path, tmp_path: Path) -> None:
    def made(text: str, **options: str) -> None:
        timing = _timing(tmp_path, text)
        camkit.load(None, kind="spad", timing=timing, product="lifetime", **options).make(scan)

    with pytest.raises(ContractError, match=r"from_ps and to_ps leave 6 time bins"):
        made(TIMING + "to_ps = 1000\n" + LASER)
    with pytest.raises(ContractError, match="period_ps = 9000 is shorter"):
        made(TIMING.replace("12800", "9000") + LASER)
    with pytest.raises(UnsupportedError, match="not to scans with a gate"):
        made(TIMING.replace('"histogram"', '"gate"') + LASER)
    with pytest.raises(ContractError, match="pool does not apply to the product lifetime"):
        made(TIMING + LASER, pool="3")
    with pytest.raises(ContractError, match=r"\[lifetime\] tau_ps: is unknown; known are period"):
        made(TIMING + "tau_ps = 3\n" + LASER)


def test_dark_captures_are_told(tmp_path: Path) -> None:
    path = tmp_path / "dark.npz"
    np.savez(path, histogram=np.zeros((128, 3, 4), np.uint16))
    timing = _timing(tmp_path, TIMING + LASER)
    made = camkit.load(None, kind="spad", timing=timing, product="lifetime").make(path)
    assert not made.arrays["valid"].any()
    assert made.warnings == ("no pixel has enough photons for a reliable lifetime",)
