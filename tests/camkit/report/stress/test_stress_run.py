"""A whole quick run: journal, results, page, and the envelope in the bundle."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.manifest import Range
from camkit.bundle.reader import open_bundle
from camkit.cli.app import run as run_command
from camkit.errors import ContractError
from camkit.report.stress.curve import curve_of
from camkit.report.stress.measured_ranges import measured_ranges
from camkit.report.stress.scenario import Scenario, choose
from camkit.report.stress.score import Judge
from camkit.report.stress.stress_run import StressOptions, run_stress, write_envelope
from camkit.report.stress.sweep import Point, read_points
from camkit.report.stress.verdict import Outcome, Verdict
from camkit.runtime.envelope import OPEN_HIGH, OPEN_LOW
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from tests.wide_bundle import write_wide_bundle

KEYS = {"scenario", "knob", "unit", "values", "psnr_db", "chi2", "break_point", "ci"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    write_wide_bundle(folder)
    return folder


def _stress(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    capsys.readouterr()
    code = run_command(["stress", *map(str, arguments)])
    out, err = capsys.readouterr()
    return int(code), out, err


def test_a_quick_run_gives_json_and_a_page_and_resumes(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    call = (folder / "wide.camkit", "--quick", "--scenes", 1, "--out-dir", folder / "out")
    call = (*call, "--scenarios", "bit_depth,defocus,fp16_range", "--json")
    code, out, _ = _stress(capsys, *call)
    assert code == 0
    rows = json.loads(out)
    assert [r["scenario"] for r in rows] == ["bit_depth", "fp16_range", "defocus"]
    for row in rows:
        assert row.keys() >= KEYS
        assert all(len(curve) == len(row["values"]) for curve in row["psnr_db"].values())
    assert "stress_psf" in rows[2]["skipped"]
    assert set(rows[0]["psnr_db"]) == {"input", "wiener", "M"}
    assert rows == json.loads((folder / "out" / "stress.json").read_text())
    page = (folder / "out" / "stress.html").read_text()
    assert page.count("data:image/png;base64,") >= 3
    assert not re.search(r"(src|href)=['\"]?(https?:)?//", page)

    monkeypatch.setattr(Judge, "score", lambda *_: pytest.fail("measured again"))
    monkeypatch.setattr("camkit.report.stress.stress_run._write", lambda *_: None)
    assert json.loads(_stress(capsys, *call)[1]) == rows


def test_a_journal_that_was_cut_off_is_read_up_to_there(folder: Path) -> None:
    (journal,) = (folder / "out").glob("points-*.jsonl")
    points = read_points(journal)
    assert len(points) == 4
    cut = folder / "cut.jsonl"
    cut.write_text(journal.read_text()[:-40])
    assert read_points(cut) == points[:-1]
    cut.write_text("{}\n" + journal.read_text())
    with pytest.raises(ContractError, match="line 1"):
        read_points(cut)


def test_networks_of_another_bundle_are_shown_beside(folder: Path) -> None:
    bundle = open_bundle(folder / "wide.camkit")
    options = StressOptions(scenarios=choose("fp16_range,bit_depth"), scenes=1, quick=True)
    row = run_stress(bundle, options, earlier_bundle=bundle).rows[1]
    assert row["psnr_db"]["M"] == row["psnr_db"]["M before"]
    other = bundle.manifest.sensor.model_copy(update={"full_well_e": 1.0})
    stranger = replace(bundle, manifest=bundle.manifest.model_copy(update={"sensor": other}))
    with pytest.raises(ContractError, match="one camera"):
        run_stress(bundle, options, earlier_bundle=stranger)


@pytest.mark.parametrize("extra", [("--quick",), ("--data", ".")])
def test_ranges_of_a_quick_or_private_run_are_not_stored(
    folder: Path, capsys: pytest.CaptureFixture[str], extra: tuple[str, ...]
) -> None:
    code, _, err = _stress(capsys, folder / "wide.camkit", "--write", *extra)
    assert code == 2
    assert "--write" in err


def test_a_folder_without_large_pictures_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, _, err = _stress(capsys, folder / "wide.camkit", "--quick", "--data", folder)
    assert code == 2
    assert "pictures" in err


def test_a_written_envelope_makes_the_runtime_warn(tmp_path: Path) -> None:
    bundle = write_wide_bundle(tmp_path)
    write_envelope(bundle, {"side_px": Range(low=8, high=1e9)})
    write_envelope(open_bundle(bundle.path), {"grey_noise": Range(low=1e-5, high=0.5)})
    stored = open_bundle(bundle.path)
    assert set(stored.manifest.envelope or {}) == {"side_px", "grey_noise"}
    assert stored.names == bundle.names
    pipeline = Pipeline(stored, Options(threads=1))
    for side, warned in ((64, False), (6, True)):
        mosaic = np.full((side, 64), 300, np.uint16)
        capture = pipeline.capture_of(mosaic, iso=100, white_balance=None, origin_px=(0, 0))
        warnings = pipeline.start(capture).warnings
        assert any("side_px" in text for text in warnings) is warned
    with pytest.raises(ContractError, match="no range"):
        write_envelope(bundle, {})


def _scenario(name: str, end: str, nominal: float = 1.0) -> Scenario:
    values = (1.0, 2.0, 3.0, 4.0)
    return Scenario(
        name=name,
        title=name,
        knob="knob",
        unit="",
        values=values,
        nominal=nominal,
        quick=values,
        measure=lambda *_: Verdict(outcomes={}),
        bounds={"clipped_fraction": end},  # type: ignore[dict-item]
    )


def _curve(scenario: Scenario, gains: tuple[float | None, ...], scale: float):
    points = [
        Point(
            scenario=scenario.name,
            value=value,
            scene=f"s{j}",
            verdict=Verdict(
                outcomes={
                    "input": Outcome(psnr_db=20),
                    "wiener": Outcome(psnr_db=20),
                    "M": Outcome(psnr_db=None if gain is None else 20 + gain, chi2=1),
                },
                seen={"clipped_fraction": scale * value + 0.001 * j},
            ),
        )
        for value, gain in zip(scenario.values, gains, strict=True)
        for j in range(2)
    ]
    return curve_of(scenario, points, ("input", "wiener"))


def test_ranges_end_where_a_method_broke_or_testing_ended() -> None:
    sound = _curve(_scenario("far", "high"), (3, 3, 3, 3), 0.1)
    broken = _curve(_scenario("near", "high"), (3, 3, -1, -2), 0.05)
    alone = measured_ranges([sound], "M")["clipped_fraction"]
    assert (alone.low, alone.high) == (OPEN_LOW, pytest.approx(0.401))
    both = measured_ranges([sound, broken], "M")["clipped_fraction"]
    assert both.high == pytest.approx(0.101)
    low = _curve(_scenario("low", "low", nominal=4.0), (-1, 3, 3, 3), 0.1)
    found = measured_ranges([low], "M")["clipped_fraction"]
    assert (found.low, found.high) == (pytest.approx(0.2), OPEN_HIGH)


def test_where_nothing_could_be_compared_no_help_was_shown() -> None:
    blind = _curve(_scenario("blind", "high"), (3, 3, None, None), 0.1)
    assert measured_ranges([blind], "M")["clipped_fraction"].high == pytest.approx(0.201)


def test_what_never_helped_has_no_range() -> None:
    assert measured_ranges([_curve(_scenario("bad", "both"), (-1, -1, -1, -1), 0.1)], "M") == {}
