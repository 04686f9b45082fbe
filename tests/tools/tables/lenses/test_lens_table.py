"""The table of lenses on two of them and two steps: table, journal."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from camkit.models_def.optics.lens_file.lens_file import find_lens, write_lens
from camkit.models_def.optics.shape.phase import Monomial, Phase
from tools.tables.runner import JOURNAL

Command = Callable[..., str]

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


@pytest.fixture
def measured(tmp_path: Path, command: Command) -> Callable[..., tuple[dict[str, Any], str]]:
    """Give the command, whose answer is the record and what it prints."""
    recipe, out = tmp_path / "strip.toml", tmp_path / "lenses.json"
    recipe.write_text(RECIPE, encoding="utf-8")
    fixed = ("lenses", "measure", recipe, "-o", out, "--overwrite", "--runs", tmp_path / "runs")
    fixed = (*fixed, "--largest-kernel-px", 33, "--patches", 1, "--seeds", 1)

    def called(*words: Any) -> tuple[dict[str, Any], str]:
        said = command(*fixed, *words)
        return json.loads(out.read_text(encoding="utf-8")), said

    return called


def test_table_has_every_lens_and_depth_and_a_second_run_measures_nothing(
    measured: Callable[..., tuple[dict[str, Any], str]], tmp_path: Path
) -> None:
    words = ("--lens", "duet", "doublet=aca254-050-a", "--depths-mm", "700,1000")
    report, said = measured(*words)
    assert list(report["lenses"]) == ["duet", "doublet"]
    assert report["depths_mm"] == [700.0, 1000.0]
    duet = report["lenses"]["duet"]
    assert len(duet["recovered"][0]["db"]) == 2
    assert len(duet["recovered"][0]["ssim"][0]) == 2
    # no network of two steps recovers anything: it shows the capture, sharper at 1 m
    assert duet["capture"]["db"][1][0] > duet["capture"]["db"][0][0]
    # the doublet's 20 degrees do not fit into 33 px
    assert report["lenses"]["doublet"]["held"][1][1] < 0.2
    assert "| lens | 700 mm | 1000 mm | spread |" in said
    assert "duet: seed 1" in said
    journal = (tmp_path / "runs" / JOURNAL).read_text(encoding="utf-8")
    assert len(journal.splitlines()) == 4
    again, quiet = measured(*words)
    assert again == report
    assert "duet: seed 1" not in quiet
    assert (tmp_path / "runs" / JOURNAL).read_text(encoding="utf-8") == journal


def test_a_front_alone_is_judged_at_azimuths_with_the_filter_that_suits_each_lens(
    measured: Callable[..., tuple[dict[str, Any], str]], tmp_path: Path
) -> None:
    plate = find_lens("duet")
    terms = (Monomial(p=3, q=0, coefficient_rad=40.0), Monomial(p=0, q=3, coefficient_rad=40.0))
    front = replace(plate.surfaces[0], phase=Phase(radius_mm=6.25, free_rad=terms))
    write_lens(replace(plate, surfaces=(front, *plate.surfaces[1:])), tmp_path / "plate.toml")
    recipe = tmp_path / "strip.toml"
    sides = "fields = 2\nazimuths_deg = [0.0, 180.0]"
    recipe.write_text(RECIPE.replace("fields = 2", sides), encoding="utf-8")
    words = ("--lens", "duet", tmp_path / "plate.toml", "--front", "wiener", "--seeds", 0)
    depths = ("--depths-mm", "800,1000", "--signal-to-noise", 0.01, 30.0)
    report, said = measured(*words, *depths)
    duet, cubic = report["lenses"]["duet"], report["lenses"]["plate"]
    assert report["field_angles_deg"] == [0.0, 20.0, 20.0]
    assert {duet["signal_to_noise"], cubic["signal_to_noise"]} <= {0.01, 30.0}
    assert [len(fields) for fields in cubic["front"]["db"]] == [3, 3]
    # a round lens is the same at both azimuths
    assert duet["rms_um"][0][1] == pytest.approx(duet["rms_um"][0][2], rel=1e-3)
    assert min(cubic["likeness"]) > min(duet["likeness"])
    assert "| lens | 800 mm | 1000 mm | spread |" in said
    assert "Axial colour" in said


def test_two_lenses_of_one_name_are_refused(
    measured: Callable[..., tuple[dict[str, Any], str]],
) -> None:
    with pytest.raises(SystemExit, match="two lenses are called lens"):
        measured("--lens", "a/lens.toml", "b/lens.toml")


def test_a_wider_margin_gives_the_filter_all_of_a_wide_kernel(
    measured: Callable[..., tuple[dict[str, Any], str]],
) -> None:
    pages = {}
    for margin in (4, 16):
        words = ("--lens", "aca254-050-a", "--front", "wiener", "--filter-margin-px", margin)
        report, pages[margin] = measured(*words)
        assert report["recovered_px"] == 24 + 2 * margin
    assert "which it mars" in pages[4]
    assert "which it mars" not in pages[16]
