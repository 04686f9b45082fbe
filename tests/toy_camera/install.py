"""The toy camera as if somebody had installed it."""

from collections.abc import Iterator

import pytest

from camkit.kinds import GROUP
from tests.installed_package import Points, installed

PACKAGE = "toy-camera"
POINTS: Points = {GROUP: {"toy": "tests.toy_camera:KIND"}}


@pytest.fixture(scope="module")
def toy_installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Install the toy camera for a module."""
    with installed(tmp_path_factory.mktemp("site"), PACKAGE, POINTS):
        yield
