from dataclasses import replace

import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.glass.catalogue import find_glass
from camkit.models_def.optics.glass.table import glass_table, parse_glass_table

GLASS = replace(find_glass("N-BK7"), stated_index_d=None, stated_abbe_number=None)
TABLE = {
    key: list(value) if isinstance(value, tuple) else value
    for key, value in glass_table(GLASS).items()
}


def test_glass_comes_back_from_its_table() -> None:
    assert parse_glass_table(TABLE) == GLASS


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"extra": 1}, "unknown key 'extra'"),
        ({"name": 1}, "name must be a text"),
        ({"range_um": [0.3]}, "range_um"),
        ({"range_um": 0.3}, "range_um must be a list"),
        ({"coefficients": ["1"]}, r"coefficients\[0\] must be a number"),
        ({"formula": "magic"}, "formula must be one of"),
    ],
)
def test_wrong_table_is_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ContractError, match=message):
        parse_glass_table({**TABLE, **change})
