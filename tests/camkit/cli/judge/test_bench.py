"""`camkit bench`: the built-in bundle in a quick run, and refusals before any work."""

import json
from pathlib import Path

import pytest

from camkit.bundle.reader import built_in_bundles
from camkit.cli.exit_code import ExitCode
from tests.spad_bundle import write_spad_bundle
from tests.wide_bundle import write_wide_bundle


def test_a_quick_bench_of_the_built_in_bundle_gives_rows_chart_and_page(
    tmp_path: Path, camkit_command
) -> None:
    if "duet" not in built_in_bundles():
        pytest.skip("the built-in bundle was not exported yet")
    outcome = camkit_command(
        *("bench", "duet", "--quick", "--sizes", "S", "--methods", "net,develop", "--repeat", "1"),
        *("--dtypes", "fp32,fp16", "--width", "256", "--height", "192"),
        *("--out-dir", tmp_path / "out", "--work-dir", tmp_path / "work", "--json"),
    )
    assert outcome.code == 0, outcome.err
    report = json.loads(outcome.out)
    assert report["machine"]["threads"] >= 1
    rows = {row["label"]: row for row in report["rows"]}
    assert set(rows) == {"develop", "S", "S fp16"}
    for row in rows.values():
        assert (row["bundle"], row["n"], row["width"], row["height"]) == ("duet", 1, 256, 192)
        assert row["error"] is None
        assert (row["psf"], row["images"]) == ("bundle", 3)
    assert rows["S"]["psnr_db"] > rows["S"]["input_psnr_db"] == rows["develop"]["psnr_db"]
    # weights rounded to fp16 cost next to nothing, and are not the same
    assert rows["S fp16"]["psnr_db"] == pytest.approx(rows["S"]["psnr_db"], abs=0.05)
    assert rows["S fp16"]["psnr_db"] != rows["S"]["psnr_db"]
    written = {path.suffix for path in (tmp_path / "out").iterdir()}
    assert {".json", ".csv", ".html"} <= written


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "give a NAME or PATH, or --all"),
        (["duet", "--threads", "many"], "--threads takes whole numbers"),
        (["duet", "--modes", "slow"], "modes are exact, fast, whole; got slow"),
        (["duet", "--repeat", "0"], "repeat must be >= 1"),
    ],
)
def test_a_wrong_option_ends_with_2_before_any_work(
    arguments: list[str], words: str, camkit_command
) -> None:
    outcome = camkit_command("bench", *arguments)
    assert outcome.code == ExitCode.USAGE
    assert words in outcome.err


def test_an_unknown_bundle_ends_with_3(camkit_command) -> None:
    assert camkit_command("bench", "nobody").code == ExitCode.BUNDLE_REFUSED


def test_people_get_a_table_and_reasons(tmp_path: Path, camkit_command) -> None:
    bundle = write_wide_bundle(tmp_path)
    outcome = camkit_command(
        *("bench", bundle.path, "--quick", "--methods", "develop,net", "--sizes", "L"),
        *("--repeat", "1", "--out-dir", tmp_path / "out", "--work-dir", tmp_path / "work"),
    )
    assert outcome.code == 0, outcome.err
    head, row, written = outcome.out.splitlines()
    assert head.split()[:2] == ["bundle", "method"]
    assert row.split()[:2] == ["tiny", "develop"]
    assert "bench.html" in written
    assert "not measured: tiny L: the bundle holds M" in outcome.err


def test_an_array_of_single_photons_measures_itself(tmp_path: Path, camkit_command) -> None:
    bundle, out = write_spad_bundle(tmp_path), tmp_path / "out"
    words = ("bench", bundle.path, "--quick", "--images", "1", "--repeat", "1", "--out-dir", out)
    outcome = camkit_command(*words, "--json")
    assert outcome.code == 0, outcome.err
    report = json.loads(outcome.out)
    assert {"machine", "settings", "rows", "skipped"} <= report.keys()
    assert {row["sort"] for row in report["rows"]} == {"picture", "timing", "seconds"}
    assert {path.name for path in out.iterdir()} == {"bench.json", "bench.csv"}
    refused = camkit_command(*words, "--methods", "net")
    assert refused.code == ExitCode.USAGE
    assert "--methods does not apply to it" in refused.err
