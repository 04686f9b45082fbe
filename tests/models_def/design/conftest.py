from collections.abc import Mapping
from typing import Any

import pytest

from camkit.models_def.design.design_recipe import DesignRecipe, to_design
from tests.small_design import small_design


@pytest.fixture
def table() -> dict[str, Any]:
    return small_design()


@pytest.fixture
def recipe(table: Mapping[str, Any]) -> DesignRecipe:
    return to_design(table)
