"""tools/lens/plate_figures.py: the phase is that of eq. (3.3), spots lose no light."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from camkit.models_def.optics.thin.peak import LandedLight
from camkit.models_def.optics.thin.recipe import RECIPES, find_thin_recipe
from camkit.models_def.optics.thin.solver import solve_plate
from tests.tiny_design import run_tool
from tools.lens import plate_figures

QUICK = "\n[solver]\nsteps = 6\nrays = 12\n"


@pytest.fixture
def quick(tmp_path: Path) -> Path:
    """Give the shipped recipe, solved in a moment."""
    path = tmp_path / "quick.toml"
    path.write_text((RECIPES / "thin_plate_lens.toml").read_text("utf-8") + QUICK, "utf-8")
    return path


def test_both_figures_and_their_numbers_are_written(
    quick: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, value in (("GRID", 40), ("SPOT_RAYS", 3000), ("FAN", 9)):
        monkeypatch.setattr(plate_figures, name, value)
    out = tmp_path / "out"
    run_tool(monkeypatch, "lens.plate_figures", quick, "-o", out)
    told = json.loads((out / "figures.json").read_text("utf-8"))
    assert [d["field_angle_deg"] for d in told["directions"]] == pytest.approx(
        np.linspace(0, 28.6, 7), abs=1e-3
    )
    assert told["directions"][0]["centre_mm"] == 0
    assert len(told["spots"]) == 3
    for spot in told["spots"]:
        assert 0.01 < spot["within_10_px"] < spot["within_450_px"] <= 1
    assert len(capsys.readouterr().out.splitlines()) == 2 + 7
    for name in ("phase.png", "apertures.png"):
        assert (out / name).stat().st_size > 10_000


def test_the_map_is_the_closed_form_on_the_axis_and_keeps_its_phase_when_wrapped(
    quick: Path,
) -> None:
    recipe = find_thin_recipe(quick)
    radii = np.linspace(-11.0, 11.0, 23)
    found = plate_figures.phase_map(recipe, solve_plate(recipe), radii, np.array([0.0, 0.2]))
    length, wave_mm = recipe.plate.efl_mm, recipe.plate.wavelength_um / 1000
    wanted = -2 * math.pi / wave_mm * (np.hypot(length, radii) - length)
    assert found[:, 0] == pytest.approx(wanted, rel=1e-9, abs=1e-6)
    # off the axis no plane of symmetry is left
    assert abs(found[0, 1] - found[-1, 1]) > 100
    wound = plate_figures.wrapped(found)
    assert wound.min() >= 0
    assert wound.max() < plate_figures.WRAP_PI
    turns = (found / math.pi - wound) / plate_figures.WRAP_PI
    assert turns == pytest.approx(np.rint(turns), abs=1e-9)


def test_a_spot_holds_the_light_of_its_window_alike_on_both_sides() -> None:
    rng = np.random.default_rng(3)
    light = LandedLight(
        x_px=rng.uniform(0, 30, 500),
        y_px=100 + rng.uniform(-30, 30, 500),
        share=np.full(500, 1 / 500),
        lost={},
    )
    picture = plate_figures.spot_image(light, 100.0, 20, step_px=1)
    near = (light.x_px < 20) & (np.abs(light.y_px - 100) < 20)
    assert picture.sum() == pytest.approx(near.mean())
    assert picture == pytest.approx(picture[:, ::-1])


def test_a_recipe_that_is_not_there_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(SystemExit, match="nowhere"):
        run_tool(monkeypatch, "lens.plate_figures", "nowhere", "-o", tmp_path)
