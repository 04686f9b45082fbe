"""What camkit refuses is said in one printable line, whatever a file put into it."""

import pytest

from camkit.errors import BundleError, CamkitError, ContractError


@pytest.mark.parametrize("kind", [CamkitError, BundleError, ContractError])
def test_a_message_is_one_printable_line(kind: type[CamkitError]) -> None:
    error = kind("node 'a\nb\x1b[31m' is\r\n refused\u2028now")
    assert str(error) == "node 'a b?[31m' is refused now"


def test_a_long_message_is_cut() -> None:
    """In its middle: the reason stands behind a long name."""
    text = str(BundleError("x" * 10**6 + ": the reason"))
    assert (len(text), text[-12:]) == (1000, ": the reason")
    assert "x...x" in text


def test_a_plain_message_stays_as_it_is() -> None:
    assert str(BundleError("the name is “é”; say --size M")) == "the name is “é”; say --size M"
