"""tools/lens_table.py on two lenses and two steps: table, picture, journal."""

import json
from pathlib import Path

import pytest

from tests.tiny_design import run_tool

RECIPE = """
name = "strip"
prescription = "duet"
vary = []
[optics]
half_field_deg = 20.0
fields = 2
[pixels]
pitch_um = 6.0
[network]
name = "trimmed_unet"
config = { in_channels = 3, widths = [4, 4, 4] }
[schedule]
steps = 2
batch = 2
patch_px = 24
valid_steps = 2
valid_patches = 1
[data]
procedural_scenes = 1
scene_px = 128
"""


def test_table_has_every_lens_and_depth_and_a_second_run_measures_nothing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recipe, out = tmp_path / "strip.toml", tmp_path / "out"
    recipe.write_text(RECIPE, encoding="utf-8")
    options = [recipe, "--lens", "duet", "doublet=aca254-050-a", "--seeds", 1, "--out-dir", out]
    options += ["--largest-kernel-px", 33, "--patches", 1, "--depths-mm", "700,1000"]
    assert run_tool(monkeypatch, "lens_table", *options) == 0
    report = json.loads((out / "lens_table.json").read_text(encoding="utf-8"))
    assert list(report["lenses"]) == ["duet", "doublet"]
    assert report["depths_mm"] == [700.0, 1000.0]
    duet = report["lenses"]["duet"]
    assert len(duet["recovered"][0]["db"]) == 2
    assert len(duet["recovered"][0]["ssim"][0]) == 2
    # no network of two steps recovers anything: it shows the capture, sharper at 1 m
    assert duet["capture"]["db"][1][0] > duet["capture"]["db"][0][0]
    # the doublet's 20 degrees do not fit into 33 px
    assert report["lenses"]["doublet"]["held"][1][1] < 0.2
    assert (out / "lens_table.png").read_bytes().startswith(b"\x89PNG")
    table = (out / "lens_table.md").read_text(encoding="utf-8")
    assert "| lens | 700 mm | 1000 mm | spread |" in table
    journal = (out / "journal.jsonl").read_text(encoding="utf-8")
    assert len(journal.splitlines()) == 4
    assert run_tool(monkeypatch, "lens_table", *options) == 0
    assert (out / "journal.jsonl").read_text(encoding="utf-8") == journal
    assert (out / "lens_table.md").read_text(encoding="utf-8") == table


def test_two_lenses_of_one_name_are_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    recipe = tmp_path / "strip.toml"
    recipe.write_text(RECIPE, encoding="utf-8")
    options = [recipe, "--lens", "a/lens.toml", "b/lens.toml", "--out-dir", tmp_path]
    with pytest.raises(SystemExit, match="two lenses are called lens"):
        run_tool(monkeypatch, "lens_table", *options)


def test_a_wider_margin_gives_the_filter_all_of_a_wide_kernel(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    recipe = tmp_path / "strip.toml"
    recipe.write_text(RECIPE, encoding="utf-8")
    pages = {}
    for margin in (4, 16):
        out = tmp_path / str(margin)
        options = [recipe, "--lens", "aca254-050-a", "--seeds", 1, "--out-dir", out]
        options += ["--front", "wiener", "--filter-margin-px", margin]
        options += ["--largest-kernel-px", 33, "--patches", 1]
        assert run_tool(monkeypatch, "lens_table", *options) == 0
        report = json.loads((out / "lens_table.json").read_text(encoding="utf-8"))
        assert report["recovered_px"] == 24 + 2 * margin
        pages[margin] = (out / "lens_table.md").read_text(encoding="utf-8")
    assert "which it mars" in pages[4]
    assert "which it mars" not in pages[16]
