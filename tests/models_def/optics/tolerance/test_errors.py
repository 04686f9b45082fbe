import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.tolerance.errors import ERROR_CLASSES, ErrorWidth, Tolerances
from camkit.models_def.optics.tolerance.uniform_errors import FabricationErrors

DRAWS = (np.arange(200_000) + 0.5) / 200_000


def test_defaults_are_those_of_training_plus_decentre_and_tilt() -> None:
    base, given = FabricationErrors(), Tolerances()
    assert given.radius.half_width == base.radius_relative
    assert given.thickness.half_width == base.thickness_mm
    assert given.index.half_width == base.index
    assert given.focus.half_width == base.focus_mm
    assert given.element_decentre.half_width == given.surface_decentre.half_width == 0.02
    assert np.rad2deg(given.element_tilt.half_width) == pytest.approx(1 / 60)
    none = {"abbe", "conic", "power", "irregularity", "groove_depth", "wedge"}
    assert set(ERROR_CLASSES) - set(given.active()) == none


def test_uniform_errors_fill_their_range_evenly() -> None:
    errors = ErrorWidth(half_width=3.0).signed(DRAWS)
    assert np.abs(errors).max() < 3
    assert errors.std() == pytest.approx(3 / np.sqrt(3), rel=1e-6)


def test_normal_errors_have_the_variance_of_a_normal_law_cut_off_at_two_sigma() -> None:
    errors = ErrorWidth(half_width=3.0, distribution="normal").signed(DRAWS)
    assert np.abs(errors).max() < 3
    # 1 - 2 a phi(a) / (2 Phi(a) - 1) with a = 2
    assert errors.var() == pytest.approx(1.5**2 * (1 - 4 * 0.0539909665 / 0.9544997361), rel=1e-4)


def test_uniform_decentres_fill_the_disc() -> None:
    length = ErrorWidth(half_width=2.0).length(DRAWS)
    assert (length**2).mean() == pytest.approx(2.0**2 / 2, rel=1e-6)


def test_normal_decentres_stay_in_the_disc_and_crowd_in_its_middle() -> None:
    length = ErrorWidth(half_width=2.0, distribution="normal").length(DRAWS)
    assert length.max() <= 2
    # r^2 / (2 sigma^2) is exponential, cut off at 2: mean 1 - 2 e^-2 / (1 - e^-2)
    cut = np.exp(-2)
    assert (length**2).mean() / 2 == pytest.approx(1 - 2 * cut / (1 - cut), rel=1e-4)


def test_only_keeps_one_class_and_the_compensator() -> None:
    alone = Tolerances(compensator="spot").only("index")
    assert alone.active() == ("index",)
    assert alone.compensator == "spot"


@pytest.mark.parametrize(
    "make",
    [
        lambda: ErrorWidth(half_width=-1.0),
        lambda: ErrorWidth(half_width=float("nan")),
        lambda: ErrorWidth(half_width=1.0, distribution="flat"),  # type: ignore[arg-type]
        lambda: Tolerances(radius=ErrorWidth(half_width=0.6)),
        lambda: Tolerances(groove_depth=ErrorWidth(half_width=0.6)),
        lambda: Tolerances(element_tilt=ErrorWidth(half_width=1.0)),
        lambda: Tolerances(compensator="hope"),  # type: ignore[arg-type]
    ],
)
def test_senseless_widths_are_refused(make) -> None:
    with pytest.raises(ContractError):
        make()
