"""A chart at the focus of an ideal lens is an object at infinity."""

import math
import re

import pytest

from camkit.errors import UnsupportedError
from camkit.models_def.optics.lens_file.zmx_reader import parse_zmx
from tests.zmx_factory import BACK, FRONT, HEAD, OBJECT

COLLIMATOR = """SURF 1
  TYPE PARAXIAL
  CURV 0.0 0 0.0 0.0 0
  PARM 1 100
  PARM 2 1
  DISZ 10
  DIAM 35 0 0 0 1 ""
"""
FAR = HEAD.replace("ENPD 2.286E+1", "FNUM 2 0") + OBJECT + FRONT + BACK


def experiment(collimator: str = COLLIMATOR, chart_mm: float = 100.0) -> str:
    """Return the file of the lens behind a chart and a collimator."""
    text = FAR.replace("FTYP 0 0 1", "FTYP 1 0 2").replace("YFLN 0 0", "YFLN 0 26.5", 1)
    text = text.replace("DISZ INFINITY", f"DISZ {chart_mm:g}")
    head, found, rest = text.partition("SURF 1\n")
    moved = re.sub(r"SURF (\d+)", lambda m: f"SURF {int(m[1]) + 1}", found + rest)
    return head + collimator + moved


def test_a_collimated_chart_is_an_object_at_infinity() -> None:
    alone, behind = parse_zmx(FAR), parse_zmx(experiment())
    assert math.isinf(behind.lens.object_distance_mm)
    assert behind.lens.surfaces == alone.lens.surfaces
    assert behind.lens.stop == alone.lens.stop
    assert behind.lens.field_angles_rad == pytest.approx([0.0, math.atan(0.265)])
    assert not any("ideal lens" in note for note in alone.notes)
    (note,) = (note for note in behind.notes if "ideal lens" in note)
    assert "of focal length 100 has the object at its focus: left out" in note


@pytest.mark.parametrize(
    "text",
    [
        experiment(chart_mm=90.0),
        experiment(COLLIMATOR.replace("PARM 1 100", "PARM 1 -100")),
        experiment().replace("FTYP 1 0", "FTYP 0 0"),
        experiment().replace("FNUM 2 0", "ENPD 2.286E+1"),
    ],
    ids=["not at the focus", "spreads light", "fields as angles", "pupil of the collimator"],
)
def test_another_ideal_lens_is_refused_by_its_name(text: str) -> None:
    with pytest.raises(UnsupportedError, match="surface 1 is of type PARAXIAL"):
        parse_zmx(text)
