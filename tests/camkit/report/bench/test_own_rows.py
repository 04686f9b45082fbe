"""Kinds that measure themselves: their rows in one report, and what means nothing to them."""

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from camkit.bundle.reader import Bundle
from camkit.errors import ContractError
from camkit.report.bench import own_rows
from camkit.report.bench.output import write_bench
from camkit.report.bench.own_rows import own_lines
from camkit.report.bench.part import BenchPart, OwnRows, OwnSettings, Tell
from camkit.report.bench.run import run_bench
from camkit.report.bench.settings import Settings
from camkit.report.bench.trial import Axes, Skip
from tests.bundle_factory import write_tiny_bundle

ROWS = ({"sort": "one", "psnr_db": 30.25}, {"sort": "two", "seconds": 1.5, "size": None})


class _Kind:
    """Measures itself, and remembers what it was asked for."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, OwnSettings]] = []

    def measure(self, bundle: Bundle, settings: OwnSettings, tell: Tell) -> OwnRows:
        self.asked.append((bundle.manifest.name, settings))
        tell("measuring")
        return OwnRows(rows=ROWS, skips=(Skip(what="three", reason="too dark"),))


@pytest.fixture
def kind(monkeypatch: pytest.MonkeyPatch) -> _Kind:
    """Let the kind of the tiny bundle measure itself."""
    made = _Kind()
    monkeypatch.setattr(own_rows, "find_part", lambda *_: BenchPart(measure=made.measure))
    return made


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(bundles=(str(write_tiny_bundle(tmp_path)),))


def test_a_kind_that_measures_itself_gives_machine_settings_and_rows(
    kind: _Kind, settings: Settings, tmp_path: Path
) -> None:
    told: list[str] = []
    asked = replace(
        settings, data=tmp_path, images=3, axes=Axes(sizes=("S",)), small=True, repeat=2
    )
    result = run_bench(asked, told.append)
    report = result.report
    assert result.self_measured
    assert told == ["measuring"]
    assert kind.asked == [
        ("tiny", OwnSettings(data=tmp_path, images=3, sizes=("S",), quick=True, repeat=2))
    ]
    assert report["machine"]["cores"] > 0
    assert report["settings"]["data"] == tmp_path.name
    assert [row["bundle"] for row in report["rows"]] == ["tiny", "tiny"]
    assert report["skipped"] == [{"what": "three", "reason": "too dark"}]
    tuned = {(entry["method"], entry["size"]): entry for entry in report["tuning"]}
    assert tuned["net", "M"]["captures"] == "untrained"
    assert tuned["wiener", None]["source"] == "stage wiener of the bundle"
    assert str(tmp_path) not in json.dumps(report)


def test_its_report_is_written_as_json_and_csv(
    kind: _Kind, settings: Settings, tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "bench.html").write_text("of another bench", encoding="utf-8")
    result = run_bench(settings)
    files = write_bench(result, folder)
    assert [file.name for file in files] == ["bench.json", "bench.csv"]
    assert sorted(folder.iterdir()) == sorted(files)
    assert json.loads(files[0].read_text(encoding="utf-8"))["rows"] == result.report["rows"]
    with files[1].open(encoding="utf-8", newline="") as file:
        assert [row["psnr_db"] for row in csv.DictReader(file)] == ["30.25", ""]


@pytest.mark.parametrize(
    ("changes", "option"),
    [
        ({"axes": Axes(methods=("net",))}, "--methods"),
        ({"axes": Axes(threads=(1,))}, "--threads"),
        ({"axes": Axes(modes=("fast",))}, "--modes"),
        ({"axes": Axes(tiles_px=(64,))}, "--tile"),
        ({"width_px": 64}, "--width"),
        ({"saturate": 0.1}, "--saturate"),
        ({"work_dir": Path("work")}, "--work-dir"),
        ({"constants": {"nits_per_unit": 1.0}}, "--nits-per-unit"),
    ],
)
def test_what_means_nothing_to_it_is_refused_by_name(
    kind: _Kind, settings: Settings, changes: dict[str, Any], option: str
) -> None:
    with pytest.raises(ContractError, match=f"no photographs, so {option} does not apply to it"):
        run_bench(replace(settings, **changes))
    assert kind.asked == []


def test_it_is_not_benched_beside_photographs(
    settings: Settings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parts = iter([BenchPart(), BenchPart(measure=_Kind().measure)])
    monkeypatch.setattr(own_rows, "find_part", lambda *_: next(parts))
    other = tmp_path / "other"
    other.mkdir()
    path = write_tiny_bundle(other)
    beside = replace(settings, references=(str(path.rename(other / "rival.camkit")),))
    with pytest.raises(ContractError, match="measures itself: bench it in a call of its own"):
        run_bench(beside)


def test_every_sort_of_row_is_a_table_without_empty_columns() -> None:
    assert own_lines(ROWS) == ["one", "psnr_db", "30.25", "", "two", "seconds", "1.5"]
    assert own_lines([{"a": None, "b": "x"}, {"a": 1, "b": "yy"}]) == ["a  b", "-  x", "1  yy"]
