"""Means, spreads and what lies below its input, by hand; tables hold what was measured."""

from itertools import product
from typing import Any

import pytest

from tools.tables.hdr.night_record import (
    OF_BARE,
    Measured,
    below_input,
    record_of,
    tables_text,
)
from tools.tables.hdr.night_scenes import GROUPS, Scene, night_scenes
from tools.tables.hdr.night_table import LDR, ROWS
from tools.tables.journal import Entry
from tools.tables.table_rows import Row, chosen_rows

LDR_DB = {"night:0": 30.0, "night:1": 40.0, "a.exr": 60.0, "b.exr": 80.0}
GROUPED = {"night": ["night:0", "night:1"], "files_easy": ["a.exr", "b.exr"]}


def entry(run: str, scene: str, db: float, **scores: float) -> Entry:
    found = {"hdr_psnr_db": db, "unclipped_psnr_db": 41.0, OF_BARE: 40.0} | scores
    return {"run": run, "scene": scene, "cpu_s": 2.0, "scores": found}


@pytest.fixture
def network() -> Row:
    (row,) = chosen_rows(ROWS, ["streak-4.network"])
    return row


@pytest.fixture
def found(network: Row) -> Measured:
    """The seeds gain 9, 10 and 11 dB; on b.exr none of them needs to gain."""
    entries = [entry(LDR.key, scene, db) for scene, db in LDR_DB.items()]
    for run, scene in product(network.runs, LDR_DB):
        db = 66.0 if scene == "b.exr" else LDR_DB[scene] + 8 + run.seed
        entries.append(entry(run.name, scene, db, stops_rmse=1.25))
    return Measured(
        groups=dict(GROUPED),
        entries={(e["run"], e["scene"]): e for e in entries},
        rows_left_out={"streak-4.thesis": "no weights"},
        scenes_left_out={"c.exr": "torn"},
    )


def test_means_are_over_scenes_and_the_spread_over_seeds(found: Measured, network: Row) -> None:
    rows = (LDR, network, *chosen_rows(ROWS, ["streak-4.thesis"]))
    record = record_of(LDR.key, rows, found, {"streak-4.network-2": {"steps": 7}})
    assert set(record["rows"]) == {LDR.key, network.key}
    row = record["rows"][network.key]
    assert row["trained"] == {"streak-4.network-2": {"steps": 7}}
    gain = row["groups"]["night"]["gain_db"]
    assert (gain["mean"], gain["std_of_seeds"]) == (10.0, 1.0)
    assert gain["std_of_scenes"] == 0
    db = row["groups"]["night"]["hdr_psnr_db"]
    assert (db["mean"], db["std_of_scenes"]) == (45.0, pytest.approx(50**0.5))
    assert row["groups"]["night"]["unclipped_over_bare_db"]["mean"] == 1.0
    assert row["scenes"]["night:1"] == [49.0, 50.0, 51.0]
    ldr = record["rows"][LDR.key]["groups"]["night"]
    assert ldr["hdr_psnr_db"]["std_of_seeds"] is None
    assert "stops_rmse" not in ldr


def test_one_seed_below_its_input_is_enough_unless_it_is_good(
    found: Measured, network: Row
) -> None:
    """66 dB are enough where the bare lens has 80; 59.4 are not where it has 60."""
    names = [run.name for run in network.runs]
    assert below_input(LDR.key, names, found) == []
    found.entries[names[2], "a.exr"] = entry(names[2], "a.exr", 59.4)
    assert below_input(LDR.key, names, found) == ["a.exr"]
    found.entries[names[2], "a.exr"] = entry(names[2], "a.exr", 59.6)
    found.entries[names[0], "b.exr"] = entry(names[0], "b.exr", 64.9)
    assert below_input(LDR.key, names, found) == ["b.exr"]


def test_a_picture_that_clipped_everywhere_has_no_unclipped_pixels(network: Row) -> None:
    scores = {"hdr_psnr_db": 30.0}
    alone = Measured(
        groups={"night": ["night:0"]},
        entries={
            (name, "night:0"): {"run": name, "scene": "night:0", "cpu_s": 1.0, "scores": scores}
            for name in (LDR.key, *(run.name for run in network.runs))
        },
    )
    means = record_of(LDR.key, (network,), alone, {})["rows"][network.key]["groups"]["night"]
    assert "unclipped_over_bare_db" not in means
    assert means["gain_db"] == {"mean": 0.0, "std_of_seeds": 0.0, "std_of_scenes": None}


def test_tables_hold_every_row_and_say_what_is_missing(found: Measured, network: Row) -> None:
    names = [run.name for run in network.runs]
    found.entries[names[0], "a.exr"] = entry(names[0], "a.exr", 50.0, stops_rmse=1.25)
    text = tables_text(record_of(LDR.key, (LDR, network), found, {}))
    assert f"**{GROUPS['night']}** (2)" in text
    assert "| LDR: bare lens, clipped | 35.0 |  |  | 41.0 |  | 2.00 |" in text
    assert "| 45.0 +- 1.00 | +10.0 +- 1.00 | 1.25 +- 0.00 | 41.0 +- 0.00 | +1.0 +- 0.00 |" in text
    assert "below the lesser of LDR - 0.5 and 65 dB on a.exr" in text
    assert "- streak-4.thesis is left out: no weights" in text
    assert "- c.exr is left out: torn" in text


def test_scenes_fall_into_groups_by_their_bare_picture(tmp_path: Any) -> None:
    night = next(night_scenes())
    real, other = (Scene(name=n, number=0, path=tmp_path / n) for n in ("CandleGlass.exr", "x.hdr"))
    assert [scene.group(45.0) for scene in (night, real, other)] == ["night", "real", "other"]
    assert [scene.group(45.1) for scene in (night, real)] == ["night_easy", "files_easy"]
