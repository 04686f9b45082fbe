"""The lensless camera as if somebody had installed it: a kind, and a stage of its own."""

from collections.abc import Iterator

import pytest

from camkit import kinds
from camkit.bundle.stages import register
from tests.installed_package import Points, installed
from tests.lensless_camera import PACKAGE

POINTS: Points = {
    kinds.GROUP: {"lensless": "tests.lensless_camera:KIND"},
    register.GROUP: {"lensless_admm": "tests.lensless_camera.entry:LenslessAdmm"},
}


@pytest.fixture(scope="module")
def lensless_installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Install the camera for a module."""
    with installed(tmp_path_factory.mktemp("site"), PACKAGE, POINTS):
        yield
