import math

import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.glass.material import FORMULAS, Formula, Glass


@pytest.mark.parametrize("formula", FORMULAS)
def test_no_formula_takes_no_coefficients(formula: Formula) -> None:
    with pytest.raises(ContractError, match="do not fit"):
        Glass(name="x", formula=formula, coefficients=(), source="test")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"name": ""}, "needs a name"),
        ({"formula": "magic"}, "formula must be one of"),
        ({"coefficients": (math.nan,)}, "do not fit"),
        ({"coefficients": (1.5, 1.6)}, "do not fit"),
        ({"range_um": (0.7, 0.4)}, "range_um"),
        ({"range_um": (math.nan, 0.4)}, "range_um"),
    ],
)
def test_wrong_glass_is_refused(change: dict[str, object], message: str) -> None:
    good = {"name": "x", "formula": "constant", "coefficients": (1.5,), "source": "test"}
    with pytest.raises(ContractError, match=message):
        Glass(**{**good, **change})  # type: ignore[arg-type]
