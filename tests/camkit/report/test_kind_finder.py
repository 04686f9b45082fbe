"""What a tool asks of a kind is found in its PART, and its absence is said by name."""

from pathlib import Path
from types import ModuleType

import pytest

from camkit.bundle.reader import Bundle, built_in_bundles
from camkit.errors import ContractError, UnsupportedError
from camkit.kinds import KINDS, Kind
from camkit.report.bench.part import BenchPart
from camkit.report.kind import ReportPart
from camkit.report.kind_finder import find_part
from camkit.report.quality import expose
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import stress_scenes
from camkit.report.stress.score import judge_of
from camkit.report.stress.stress_part import StressPart
from camkit.report.stress.stress_run import StressOptions, run_stress
from camkit.report.stress.verdict import Outcome, Verdict
from camkit.runtime.kind import runtime_part
from camkit.runtime.kind_parts.picture_files import PICTURES


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_camkit_has_its_parts(kind: str) -> None:
    part = find_part(kind, "bench", BenchPart)
    # a kind whose captures are no photographs measures itself
    makes_products = runtime_part(kind).outputs is not PICTURES
    assert (part.measure is not None) == makes_products
    assert isinstance(find_part(kind, "stress", StressPart), StressPart)


def _bring(monkeypatch: pytest.MonkeyPatch, module: ModuleType) -> None:
    """Let every kind have a module as its part of the reports."""
    monkeypatch.setattr(Kind, "has_part", lambda *_: True)
    monkeypatch.setattr(Kind, "part", lambda *_: module)


def test_an_unknown_kind_and_a_part_of_another_type_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with pytest.raises(UnsupportedError, match="no kind of camera 'plate'"):
        find_part("plate", "bench", BenchPart)
    hollow = ModuleType("hollow")
    _bring(monkeypatch, hollow)
    with pytest.raises(ContractError, match="hollow must define PART as a ReportPart with a Bench"):
        find_part("bayer", "bench", BenchPart)


def test_a_kind_without_a_part_takes_photographs_as_any(monkeypatch: pytest.MonkeyPatch) -> None:
    mine = Kind(name="mine", title="", sensor="bayer", stages=(), metrics=(), home="nobody_has_it")
    monkeypatch.setitem(KINDS, "mine", mine)
    assert find_part("mine", "bench", BenchPart) == BenchPart(photograph=expose)
    stress = find_part("mine", "stress", StressPart)
    assert stress == StressPart(scenes=stress_scenes, examiner=judge_of)


class _Counter:
    """Judges a camera that takes no photographs: the scenes are names, its captures numbers."""

    methods = ("guess", "count")
    rivals = ("guess",)
    primary = "count"
    identity = ("counter",)

    def score(self, shot: int) -> Verdict:
        gain = 10 - shot
        return Verdict(
            outcomes={"guess": Outcome(psnr_db=20), "count": Outcome(psnr_db=20 + gain, chi2=1)}
        )

    def pictures(self, shot: int) -> dict[str, object]:
        return {}


class _Named:
    name = "dark"


def test_a_kind_may_bring_scenes_and_an_examiner_of_another_sort(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    from camkit.bundle.reader import open_bundle
    from tests.bundle_factory import write_tiny_bundle

    bundle: Bundle = open_bundle(write_tiny_bundle(tmp_path_factory.mktemp("counter")))
    part = ReportPart(
        bench=find_part("bayer", "bench", BenchPart),
        stress=StressPart(
            scenes=lambda _bundle, count, _folder: (_Named(),) * min(count, 1),
            examiner=lambda _bundle, _sizes, _before: _Counter(),  # type: ignore[arg-type, return-value]
        ),
    )
    module = ModuleType("counting")
    module.PART = part  # type: ignore[attr-defined]
    _bring(monkeypatch, module)
    rate = Scenario(
        name="rate",
        title="Rate",
        knob="rate",
        unit="Hz",
        values=(0.0, 8.0, 16.0),
        nominal=0.0,
        quick=(0.0, 16.0),
        shoot=lambda _judge, _scene, value: int(value),
        applies=lambda _bundle: None,
    )
    (row,) = run_stress(bundle, StressOptions(scenarios=(rate,))).rows
    assert row["psnr_db"] == {"guess": [20, 20, 20], "count": [30, 22, 14]}
    assert row["break_point"] == pytest.approx(8 + 8 * 2.05 / 8)
    assert row["break_reason"] == "below guess"


def test_a_scenario_may_name_rivals_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from camkit.bundle.reader import open_bundle
    from tests.bundle_factory import write_tiny_bundle

    part = ReportPart(
        bench=find_part("bayer", "bench", BenchPart),
        stress=StressPart(
            scenes=lambda _bundle, _count, _folder: (_Named(),),
            examiner=lambda _bundle, _sizes, _before: _Counter(),  # type: ignore[arg-type, return-value]
        ),
    )
    module = ModuleType("counting")
    module.PART = part  # type: ignore[attr-defined]
    _bring(monkeypatch, module)
    rate = Scenario(
        name="rate",
        title="Rate",
        knob="rate",
        unit="Hz",
        values=(0.0, 16.0),
        nominal=0.0,
        quick=(0.0,),
        shoot=lambda _judge, _scene, value: int(value),
        applies=lambda _bundle: None,
        rivals=("count",),
    )
    bundle = open_bundle(write_tiny_bundle(tmp_path))
    (row,) = run_stress(bundle, StressOptions(scenarios=(rate,))).rows
    assert [(found["method"], found["reason"]) for found in row["breaks"]] == [
        ("guess", "below count")
    ]


def test_built_in_bundles_are_of_a_kind_that_reports_know() -> None:
    from camkit.bundle.reader import open_bundle

    for path in built_in_bundles().values():
        find_part(open_bundle(path).manifest.kind, "stress", StressPart)
