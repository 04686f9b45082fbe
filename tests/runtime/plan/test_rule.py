"""Rules are found, in their order."""

from pathlib import Path

import pytest

from camkit.errors import ContractError
from camkit.runtime.plan import rules
from camkit.runtime.plan.rule import find_rules


def test_rules_run_in_their_order() -> None:
    found = find_rules()
    assert [rule.order for rule in found] == sorted(rule.order for rule in found)
    assert {"size", "cells", "blocks", "wavelengths", "halo", "undistortion"} <= {
        rule.name for rule in found
    }


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give a folder whose modules are rules too."""
    monkeypatch.setattr(rules, "__path__", [*rules.__path__, str(tmp_path)])
    find_rules.cache_clear()
    yield tmp_path
    find_rules.cache_clear()


def test_a_new_file_is_a_new_rule(folder: Path) -> None:
    text = "ORDER = 15\ndef decide(case, work):\n    return work, None\n"
    (folder / "gating.py").write_text(text, encoding="utf-8")
    assert [rule.name for rule in find_rules()][:3] == ["scale", "size", "gating"]


def test_a_file_that_is_no_rule_is_named(folder: Path) -> None:
    (folder / "nothing.py").write_text("ORDER = 15\n", encoding="utf-8")
    with pytest.raises(ContractError, match="nothing"):
        find_rules()
