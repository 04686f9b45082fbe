"""Real captures are what is known of them; where they are not there the tests are left out."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.data_folder import data_path
from tools.spad import real_data
from tools.spad.real import edges, planes, stream, tower
from tools.spad.real.claim import Claim, table
from tools.spad.real.confocal import light_cone
from tools.spad.real.face import product
from tools.spad.real.panels import Panel, write_panels


def test_a_claim_is_met_missed_or_neither() -> None:
    met = Claim(capture="a.mat", what="rms", value=1.0, unit="mm", most=1.2)
    missed = Claim(capture="a.mat", what="share", value=0.2, least=0.25)
    plain = Claim(capture="a.mat", what="photons", value=123456.0)
    assert [claim.is_met for claim in (met, missed, plain)] == [True, False, None]
    lines = table([met, missed, plain]).splitlines()
    assert lines[0].endswith("<= 1.2 met")
    assert lines[1].endswith(">= 0.25 MISSED")
    assert lines[2].endswith("1.2346e+05")
    assert json.loads(json.dumps(met.row()))["met"] is True
    assert "met" not in plain.row()


def test_halves_hold_every_photon_once() -> None:
    cells = np.empty((2, 2), object)
    for place in np.ndindex(2, 2):
        cells[place] = np.arange(5 * sum(place))[:, None]
    first, second = tower.split(cells, np.random.default_rng(0))
    for place in np.ndindex(2, 2):
        both = np.sort(np.concatenate([first[place].ravel(), second[place].ravel()]))
        np.testing.assert_array_equal(both, cells[place].ravel())
    assert first[0, 0].shape == (1, 0)


def test_zones_are_judged_by_lines_of_other_entries() -> None:
    true_m = np.linspace(0.05, 0.4, 40)
    times = np.stack([true_m * 6000 + 70, true_m * 7000 - 20], axis=1)
    times[21] += 6
    rms, residual = planes.zone_errors_mm(times, true_m)
    assert np.isnan(residual[true_m <= 0.1]).all()
    # the entry that is 1 mm off leaves the line of its own half as it is
    assert residual[21, 0] == pytest.approx(1.0, abs=1e-6)
    assert rms[0] < 0.5


def test_a_point_behind_a_corner_is_found_by_the_light_cone() -> None:
    y, x = np.mgrid[:16, :16]
    half_m, depth_m = 0.4, 0.3
    place = (np.stack([y, x]) + 0.5) / 16 * 2 * half_m - half_m
    distance = np.sqrt(depth_m**2 + (place[0] - 0.1) ** 2 + (place[1] + 0.2) ** 2)
    frames = np.zeros((1024, 16, 16))
    at = (2 * distance / 299_792_458e-12 / 4).astype(int)
    seen = at < 1024
    frames[at[seen], y[seen], x[seen]] = 100 / distance[seen] ** 4
    found = light_cone(frames, half_m)
    _, row, column = np.unravel_index(found.argmax(), found.shape)
    assert abs(place[0][row, 0] - 0.1) < 0.08
    assert abs(place[1][0, column] + 0.2) < 0.08


def test_panels_are_written(tmp_path: Path) -> None:
    values = np.full((4, 5), np.nan)
    write_panels(tmp_path / "p.png", [Panel(title="none", values=values)] * 3, columns=2)
    assert (tmp_path / "p.png").stat().st_size > 1000


def test_absent_captures_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert real_data.main([str(tmp_path), "--out-dir", str(tmp_path / "o")]) == 1
    assert f"tower: {tower.FILE} is not in" in capsys.readouterr().err


def test_planes_lie_where_they_were_put(tmp_path: Path) -> None:
    folder = data_path("spad/" + planes.FILE).parent
    claims = {claim.what: claim for claim in planes.measure(folder, tmp_path)}
    assert claims["rms of the worst zone"].is_met


def test_stamps_of_a_stream_are_those_of_its_maker(tmp_path: Path) -> None:
    folder = data_path("spad/" + stream.FILE).parent
    assert all(claim.is_met in (True, None) for claim in stream.measure(folder, tmp_path))


def test_half_of_the_photons_show_the_tower_as_the_other_half() -> None:
    path = data_path("spad/" + tower.FILE)
    found = product(path, tower.TIMING, pool="5").arrays
    assert found["valid"].mean() > 0.25


def test_edges_of_a_real_converter_are_heeded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(edges, "PIXELS", 3)
    folder = data_path("spad/" + edges.FILE).parent
    claims = {claim.what: claim for claim in edges.measure(folder, tmp_path)}
    assert claims["rms over bound, stated"].value < 1.1
    assert claims["rms, one width for all"].value > 10
