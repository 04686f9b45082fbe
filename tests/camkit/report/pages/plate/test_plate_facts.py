"""What is told of a plate: shares that sum to one, counted in the same places with and without."""

import math
from pathlib import Path

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.geometry import Bench
from camkit.models_def.optics.diffraction.patterns import FlatPattern, StarPattern
from camkit.models_def.optics.diffraction.plate import Plate, pattern_plate
from camkit.report.pages.page import to_html
from camkit.report.pages.plate.plate_charts import farther, light_along
from camkit.report.pages.plate.plate_facts import Look, PlateFacts, analyse, to_json
from camkit.report.pages.plate.plate_page import plate_page, write_plate_page
from tests.two_colours import red_and_blue_sensor

BENCH = Bench(diameter_mm=2.0, focal_length_mm=25.0, focus_mm=2000.0)
STAR = StarPattern(angles_deg=(0.0, 60.0), near_um=40.0, far_um=200.0, share=0.1)


def _plate() -> Plate:
    return pattern_plate("star", STAR, cells=160, bench=BENCH, note="<two> lines")


@pytest.fixture(scope="module")
def facts() -> PlateFacts:
    return analyse(_plate(), Look(sensor=red_and_blue_sensor(), side_px=121))


def test_streaks_and_shares_are_those_of_the_design(facts: PlateFacts) -> None:
    told = to_json(facts)
    assert sorted(round(one["angle_deg"]) % 180 for one in told["streaks"]) == [0, 60]
    assert all(one["reach_px"] == pytest.approx(200 / 6, abs=4) for one in told["streaks"])
    for shares in (told, told["bare"]):
        for channel in ("R", "B"):
            parts = [shares[f"{name}_share"][channel] for name in ("core", "streak", "haze")]
            assert sum(parts) == pytest.approx(1, abs=2e-5)
    # the shorter the wave the deeper the phase: no plate has one share in every colour
    assert told["streak_share"]["B"] > told["streak_share"]["R"] > told["bare"]["streak_share"]["R"]
    assert told["core_share"]["B"] < told["bare"]["core_share"]["B"]
    assert told["psf_side_px"] <= 121
    assert told["depth_m"] == 2.0


def test_strehl_is_one_less_what_was_taken_from_the_core(facts: PlateFacts) -> None:
    assert facts.bare_strehl == pytest.approx(1, abs=1e-3)
    assert facts.strehl / facts.bare_strehl == pytest.approx(0.9, abs=0.01)


def test_a_flat_plate_has_no_streaks_and_all_shares_of_its_lens() -> None:
    flat = pattern_plate("flat", FlatPattern(), cells=160, bench=BENCH)
    told = to_json(analyse(flat, Look(sensor=red_and_blue_sensor(), depth_mm=math.inf, side_px=61)))
    assert told["streaks"] == []
    assert told["depth_m"] == "inf"
    assert {name: told[name] for name in told["bare"]} == told["bare"]


def test_a_depth_that_is_none_is_refused() -> None:
    with pytest.raises(ContractError, match="depth must be > 0"):
        analyse(_plate(), Look(sensor=red_and_blue_sensor(), depth_mm=0.0, side_px=21))


def test_the_page_holds_all_and_is_complete_or_not_there(facts: PlateFacts, tmp_path: Path) -> None:
    written = write_plate_page(facts, tmp_path / "new", "star")
    assert {path.name for path in written} == {path.name for path in (tmp_path / "new").iterdir()}
    page = written[0].read_text("utf-8")
    assert "&lt;two&gt; lines" in page
    for word in ("Where the light goes", "60.0°", "SILICA", "in focus at, m"):
        assert word in page
    assert page.count("data:image/svg") == 3


def test_the_page_of_a_bare_lens_says_that_there_are_no_streaks() -> None:
    bench = Bench(diameter_mm=1.0, sensor_mm=30.0)
    flat = pattern_plate("flat", FlatPattern(), cells=96, bench=bench)
    facts = analyse(flat, Look(sensor=red_and_blue_sensor(), depth_mm=500.0, side_px=31))
    page = to_html(plate_page(facts, {}))
    assert "None." in page
    assert "∞" in page
    assert "holds less than 99.5 %" in page


def test_a_slanted_line_is_cut_as_smoothly_as_an_upright_one() -> None:
    place = torch.arange(101, dtype=torch.float64) - 50
    for angle_deg in (0.0, 45.0, 30.0):
        angle = math.radians(angle_deg)
        across = -math.sin(angle) * place[None] + math.cos(angle) * place[:, None]
        line = torch.exp(-(across**2) / 2)
        light = light_along(line, angle_deg)
        assert torch.allclose(light[2:45], light[10].expand(43), rtol=0.1)
        # both arms, across a line of this width
        assert float(light[10]) == pytest.approx(2 * math.sqrt(2 * math.pi), rel=0.05)


def test_light_farther_out_falls_from_all_but_the_middle_to_what_left_the_window() -> None:
    psf = torch.zeros(11, 11, dtype=torch.float64)
    psf[5, 5], psf[5, 8], psf[0, 0] = 0.5, 0.3, 0.1
    beyond = farther(psf)
    assert beyond[[0, 2, 3, 5]].tolist() == pytest.approx([0.5, 0.5, 0.2, 0.2])
