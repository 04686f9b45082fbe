import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.models_def.design.ranking import Offender
from camkit.models_def.design.tolerance import (
    FIELDS,
    ClassLoss,
    Measured,
    ToleranceResult,
    ToleranceRun,
)
from camkit.models_def.optics.lens_file.lens_file import read_lens
from camkit.models_def.optics.tolerance.deviation import Single
from camkit.models_def.optics.tolerance.errors import Tolerances
from camkit.report.pages.lens.yield_chart import to_json, to_text, write_tolerance

PRESCRIPTIONS = Path(__file__).resolve().parents[5] / "models_def" / "prescriptions"


def measured(psnr_db: list[float]) -> Measured:
    column = np.array(psnr_db)[:, None]
    return Measured(
        psnr_db=np.repeat(column, len(FIELDS), axis=1),
        spot_rms_mm=np.full((len(psnr_db), len(FIELDS)), 0.01),
        refocus_mm=np.linspace(-0.1, 0.1, len(psnr_db)),
        gap_mm=np.linspace(-0.05, 0.02, len(psnr_db)),
        energy_kept=0.99,
    )


@pytest.fixture
def result() -> ToleranceResult:
    return ToleranceResult(
        lens=read_lens(PRESCRIPTIONS / "duet.toml"),
        tolerances=Tolerances(),
        run=ToleranceRun(copies=4),
        fields=FIELDS,
        kernel_px=65,
        nominal=measured([20.0]),
        copies=measured([19.9, 19.6, 18.5, 16.0]),
        classes=(
            ClassLoss(
                error_class="radius",
                half_width=0.002,
                loss_db=np.array([1.0, 2.0]),
                spot_growth_mm=1e-3,
            ),
        ),
        offenders=(
            Offender(
                single=Single(error_class="focus", part=None, value=-0.02),
                loss_db=0.25,
                spot_growth_mm=2e-3,
            ),
            Offender(
                single=Single(error_class="irregularity", part=3, value=1.0),
                loss_db=0.75,
                spot_growth_mm=1e-3,
            ),
        ),
    )


def test_json_has_the_yield_in_plain_numbers(result: ToleranceResult) -> None:
    found = json.loads(json.dumps(to_json(result), allow_nan=False))
    assert found["nominal_psnr_db"] == 20
    assert [row["share"] for row in found["yield"]] == [0.25, 0.5, 0.5, 0.75, 0.75]
    assert found["percentiles_db"]["p50"] == pytest.approx(19.05)
    assert found["sensitivity"] == [
        {
            "class": "radius",
            "half_width": "0.2 %",
            "loss_db": 1.5,
            "worst_loss_db": 2.0,
            "spot_growth_mm": 1e-3,
        }
    ]
    assert found["worst_offenders"][0]["error"] == "-0.02 mm"
    assert found["ranking"][0] == {
        "place": 1,
        "place_by_spots": 2,
        "class": "irregularity",
        "part": 3,
        "error": "1 fringe",
        "loss_db": 0.75,
        "spot_growth_mm": 1e-3,
        "worst_spot_growth_mm": 1e-3,
    }
    assert found["rank_agreement"] is None
    assert found["compensator_gap"] is None
    assert found["gap_mm"] == {"min": -0.05, "max": 0.02}
    assert len(found["fields"]) == len(FIELDS)
    assert found["fields"][5]["field_angle_deg"] == pytest.approx(23.26)
    assert found["fields"][0]["field_angle_deg"] == 0


def test_text_says_what_to_tighten(result: ToleranceResult) -> None:
    text = to_text(result)
    assert "20.00 dB as designed" in text
    assert "50 % within 1 dB" in text
    assert "radius" in text
    assert "0.2 %" in text
    assert "+2.000" in text
    assert text.index("worst by loss") < text.index("irregularity") < text.index("focus  ")
    assert "Spearman" not in text
    assert "tighten first: radius (1.50 dB)" in text
    assert "their limits with random signs, 2 samples:" in text
    assert "refocused at assembly: paraxial\n" in text
    gap = Tolerances(compensator="gap", compensator_gap=2)
    text = to_text(replace(result, tolerances=gap))
    assert "assembly: gap after surface 2 (-0.050 to +0.020 mm)" in text


def test_a_place_by_spots_stands_beside_the_growth_that_it_counts(result: ToleranceResult) -> None:
    """The limit that loses more is not the one with the larger spots."""
    focus = Single(error_class="focus", part=None, value=0.02)
    other = Offender(single=focus, loss_db=0.1, spot_growth_mm=9e-3)
    text = to_text(replace(result, offenders=(other, *result.offenders)))
    (row,) = (line for line in text.splitlines() if "-0.02 mm" in line and line.endswith(" 1"))
    assert "+9.000" in row


def test_files_are_the_same_from_run_to_run(result: ToleranceResult, tmp_path: Path) -> None:
    first = [path.read_bytes() for path in write_tolerance(result, tmp_path / "a", "x")]
    second = [path.read_bytes() for path in write_tolerance(result, tmp_path / "b", "x")]
    assert first == second
    assert first[0].startswith(b"\x89PNG")
    assert b"surface" not in first[1]
    assert b"radius 0.2 %" in first[1]
    assert b"irregularity 3 1 fringe" in first[1]


def test_a_run_without_errors_is_drawn_too(result: ToleranceResult, tmp_path: Path) -> None:
    none = replace(result, classes=(), offenders=())
    assert all(path.stat().st_size for path in write_tolerance(none, tmp_path, "x"))
    assert "worst by" not in to_text(none)
    assert "tighten first" not in to_text(none)
