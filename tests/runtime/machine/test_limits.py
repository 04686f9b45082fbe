"""Limits hold until somebody who trusts a bundle raises them, and a slip in doing so is told."""

import math
import re

import pytest

from camkit.errors import BundleError, ContractError
from camkit.runtime.machine.limits import Limit

LIMIT = Limit(variable="CAMKIT_MAX_TEST", default=100.0, unit="tests")


@pytest.mark.parametrize(
    ("text", "value"), [(None, 100.0), (" ", 100.0), ("2e3", 2e3), ("inf", float("inf"))]
)
def test_the_environment_overrides_the_default(text: str | None, value: float) -> None:
    assert LIMIT.value({} if text is None else {LIMIT.variable: text}) == value


@pytest.mark.parametrize("text", ["much", "0", "-1", "nan", "1 GB"])
def test_what_is_no_limit_is_told(text: str) -> None:
    with pytest.raises(ContractError, match="CAMKIT_MAX_TEST must be a number > 0"):
        LIMIT.value({LIMIT.variable: text})


@pytest.mark.parametrize("wanted", [100.1, 12_345.6, 3.3e9, float("inf"), float("nan")])
def test_the_refusal_names_a_setting_that_does(
    wanted: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(BundleError, match=r"the bank takes .* tests; at most 100") as refusal:
        LIMIT.check(wanted, "the bank")
    found = re.search(r"CAMKIT_MAX_TEST=(\S+)", str(refusal.value))
    assert found is not None
    monkeypatch.setenv(LIMIT.variable, found[1])
    if not math.isnan(wanted):
        LIMIT.check(wanted, "the bank")


def test_what_stays_within_is_admitted() -> None:
    LIMIT.check(100.0, "the bank")
