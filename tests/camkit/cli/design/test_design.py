import json
from pathlib import Path

import pytest

from camkit.cli.design.design import is_picture_due
from camkit.models_def.design.loop import DesignLoop

RECIPE = """
name = "tiny"
prescription = "duet"
[[vary]]
kind = "conic"
surface = 4
low = -4.0
high = 4.0
[optics]
half_field_deg = 12.0
fields = 3
pupil_rays = 24
[pixels]
pitch_um = 6.0
kernel_px = 33
[front]
kind = "wiener"
[schedule]
batch = 1
patch_px = 24
hold_steps = 0
valid_steps = 2
valid_patches = 2
[data]
procedural_scenes = 1
scene_px = 128
"""


def test_a_design_leaves_lens_log_and_pictures_and_goes_on(camkit_command, tmp_path: Path) -> None:
    recipe, out = tmp_path / "tiny.toml", tmp_path / "out"
    recipe.write_text(RECIPE)
    command = ("design", recipe, "--out-dir", out, "--steps", "2", "--pictures", "2")
    outcome = camkit_command(*command, "--json")
    assert outcome.code == 0, outcome.err
    report = json.loads(outcome.out)
    assert report["steps"] == 2
    assert "validation" in outcome.err
    assert (out / "tiny_000002.png").read_bytes()[:4] == b"\x89PNG"
    again = camkit_command(*command)
    assert again.code == 2
    assert "--resume" in again.err
    assert camkit_command("lens", "convert", report["lens"], tmp_path / "tiny.zmx").code == 0


def test_a_design_says_what_it_does(
    camkit_command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recipe, out = tmp_path / "tiny.toml", tmp_path / "out"
    text = RECIPE.replace("hold_steps = 0", "freeze_share = 1.0") + "[limits]\nmin_bfl_mm = 60.0\n"
    recipe.write_text(text)
    command = ("design", recipe, "--out-dir", out, "--steps", "4")
    one_step = DesignLoop._one_step

    def interrupted(loop: DesignLoop) -> float:
        if loop.step == 3:
            raise KeyboardInterrupt
        return one_step(loop)

    monkeypatch.setattr(DesignLoop, "_one_step", interrupted)
    outcome = camkit_command(*command)
    assert outcome.code == 130
    lines = (
        *("PSF by ", "times the Airy radius", "step 0: validation", "outside its [limits]"),
        *("min_bfl_mm", "stays as it is in all 4 steps", "freeze_share (1)", "--resume"),
    )
    assert [line for line in lines if line not in outcome.err] == []
    monkeypatch.undo()
    outcome = camkit_command(*command, "--resume")
    assert outcome.code == 0, outcome.err
    assert "resumes at step 2 of 4" in outcome.err
    assert "no lens was better than the one at the start" in outcome.out


def test_resume_and_overwrite_exclude_each_other(camkit_command, tmp_path: Path) -> None:
    recipe = tmp_path / "tiny.toml"
    recipe.write_text(RECIPE)
    outcome = camkit_command("design", recipe, "--resume", "--overwrite")
    assert outcome.code == 2
    assert "one of them" in outcome.err


def test_a_search_of_the_library_says_where_it_begins(camkit_command, tmp_path: Path) -> None:
    recipe, out = tmp_path / "tiny.toml", tmp_path / "out"
    search = "[starts]\nelements = 2\nscout_steps = 1\ndls_steps = 1\nlibrary_lenses = 2\n"
    recipe.write_text(RECIPE + search)
    command = ("design", recipe, "--out-dir", out, "--steps", "2", "--library", "--json")
    outcome = camkit_command(*command)
    assert outcome.code == 0, outcome.err
    start = json.loads(outcome.out)["start"]
    assert start in {"duet", "duet-joint", "aca254-050-a", "lfov-start", "lfov-joint"}
    assert f"begins at {start}" in outcome.err
    refused = camkit_command("design", recipe, "--library", "--no-search")
    assert refused.code == 2
    assert "--library is a search, and --search is off" in refused.err


@pytest.mark.parametrize(
    ("every", "expected"),
    [(100, [100, 200, 300, 350]), (30, [100, 200, 300, 350]), (150, [200, 300, 350]), (900, [350])],
)
def test_pictures_come_at_the_validation_after_every_nth_step(
    every: int, expected: list[int]
) -> None:
    drawn, last = [], 0
    for step in (100, 200, 300, 350):
        if is_picture_due(step, last, every, 350):
            drawn.append(step)
            last = step
    assert drawn == expected
