"""Makers and metrics of a camera: those that serve every camera, and those of its kind."""

from dataclasses import replace
from pathlib import Path

import pytest

from camkit.bundle.reader import Bundle
from camkit.errors import UnsupportedError
from camkit.kinds import Kind
from camkit.report.bench import common_rows, line_up
from camkit.report.bench.common_rows import COMMON
from camkit.report.bench.line_up import make_trials, makers_of, metrics_of
from camkit.report.bench.part import BenchPart, RowMaker
from camkit.report.bench.trial import Axes, Entrant, Ground
from camkit.runtime.kind import part_of
from camkit.runtime.stages import wiener
from tests.plain_bundle import SIZES, write_bankless_bundle, write_networkless_bundle
from tests.wide_bundle import write_wide_bundle

GROUND = Ground(threads=1, providers=("cpu",), free_bytes=10**10)


def labels(bundle: Bundle, axes: Axes) -> tuple[list[str], list[str]]:
    name = bundle.manifest.name
    trials, skips = make_trials([Entrant(label=name, bundle=bundle, camera=name)], axes, GROUND)
    return [trial.label for trial in trials], [f"{s.what}: {s.reason}" for s in skips]


def test_a_row_of_the_kind_stands_in_place_of_the_common_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    manifest = write_wide_bundle(tmp_path).manifest
    assert makers_of(manifest) == COMMON
    mine = RowMaker(name="develop", methods=("develop",), trials=lambda *_: ([], []))
    monkeypatch.setattr(line_up, "find_part", lambda *_: BenchPart(rows=(mine,)))
    makers = {maker.name: maker for maker in makers_of(manifest)}
    assert list(makers) == ["classical", "develop", "network", "physics"]
    assert makers["develop"] is mine


def test_a_dng_is_developed_without_its_bundle_and_other_captures_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bundle = write_wide_bundle(tmp_path)
    entrant = Entrant(label="tiny", bundle=bundle, camera="tiny")
    asked = Axes(methods=("develop",))
    assert [trial.path for trial in make_trials([entrant], asked, GROUND)[0]] == [None]
    part = replace(part_of(bundle.manifest), suffixes=(".tif",))
    monkeypatch.setattr(common_rows, "part_of", lambda _manifest: part)
    assert [trial.path for trial in make_trials([entrant], asked, GROUND)[0]] == [bundle.path]


def test_the_kind_names_its_metrics(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    manifest = write_wide_bundle(tmp_path).manifest
    assert [metric.name for metric in metrics_of(manifest)] == ["picture"]
    blind = manifest.model_copy(update={"products": {"depth_m": "picture"}})
    assert metrics_of(blind) == ()
    kind = Kind(name="bayer", title="", sensor="bayer", stages=(), metrics=("taste",))
    monkeypatch.setattr(line_up, "find_kind", lambda _name: kind)
    with pytest.raises(UnsupportedError, match=r"judged by taste; reports know .*picture"):
        metrics_of(manifest)


def test_without_a_bank_there_are_the_networks_in_its_own_sizes(tmp_path: Path) -> None:
    bundle = write_bankless_bundle(tmp_path)
    made, skips = labels(bundle, Axes(vary=False))
    assert made == ["develop", *SIZES]
    assert not skips
    _, skips = labels(bundle, Axes(methods=("wiener",)))
    assert skips == ["bankless wiener: no stage of the bundle has this method"]


def test_the_best_methods_are_those_that_a_bundle_offers(tmp_path: Path) -> None:
    few = Axes(vary=False, best=1)
    wide = write_wide_bundle(tmp_path)
    made, skips = labels(wide, few)
    assert made == ["M"]
    assert not skips
    made, skips = labels(write_networkless_bundle(tmp_path), few)
    assert made == ["wiener"]
    assert not skips
    asked = Axes(vary=False, best=1, methods=("develop",))
    assert labels(wide, asked)[0] == ["develop"]


def test_a_stage_that_knows_physics_gets_a_row_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bundle = write_wide_bundle(tmp_path)
    asked = Axes(methods=("physics",))
    assert labels(bundle, asked) == ([], ["tiny physics: no stage of the bundle has this method"])
    monkeypatch.setattr(wiener, "METHODS", (*wiener.METHODS, "physics"))
    assert labels(bundle, asked) == (["physics"], [])
    entrants = [Entrant(label="tiny", bundle=bundle, camera="tiny")]
    rival = Entrant(label="rival", bundle=bundle, camera="tiny")
    trials, _ = make_trials([*entrants, rival], Axes(vary=False), GROUND)
    kinds = [trial.maker for trial in trials if trial.method == "physics"]
    assert kinds == ["physics"]


def test_without_networks_there_is_the_bank(tmp_path: Path) -> None:
    made, skips = labels(write_networkless_bundle(tmp_path), Axes())
    assert made == ["wiener", "rl", "admm-tv", "develop"]
    assert not skips
