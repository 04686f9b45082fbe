"""The spots of one lens, and of two to one scale."""

import math
from dataclasses import replace

from camkit.models_def.optics.analysis.sampling import Pupil
from camkit.report.pages.lens.lens_facts import LensFacts, analyse
from camkit.report.pages.lens.spot_charts import COLUMNS, OtherLens, draw_spots
from tests.physics.reference_lenses import cooke_triplet


def _facts(*angles_deg: float, f_number: float = 5.0) -> LensFacts:
    lens = replace(
        cooke_triplet(),
        field_angles_rad=tuple(map(math.radians, angles_deg)),
        wavelengths_um=(0.48, 0.65),
        aperture_kind="f_number",
        aperture_value=f_number,
    )
    return analyse(lens, Pupil(sampling="gauss:4x8"), image=False)


def test_two_lenses_have_a_row_each_and_one_scale() -> None:
    other = OtherLens(name="start", facts=_facts(0, 14, f_number=4.0))
    figure = draw_spots(_facts(0), "better", other)
    titles = [panel.get_title().split()[0] for panel in figure.axes]
    assert titles == ["0°", "14°", "0°"]
    assert [panel.get_ylabel() for panel in figure.axes] == ["start", "", "better"]
    (reach_um,) = {panel.get_xlim()[1] for panel in figure.axes}
    assert reach_um > float(other.facts.max_mm.max()) * 1000
    assert all(", all " in panel.get_title() for panel in figure.axes)


def test_many_fields_of_one_lens_take_several_rows_without_a_name() -> None:
    figure = draw_spots(_facts(*range(COLUMNS + 1)), "mine")
    assert len(figure.axes) == COLUMNS + 1
    assert not any(panel.get_ylabel() for panel in figure.axes)
    assert figure.axes[-1].get_subplotspec().rowspan.start == 1
