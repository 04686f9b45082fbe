"""The laboratory's package as if somebody had installed it."""

from collections.abc import Iterator

import pytest

from camkit.calibration.psf_import import psf_source
from camkit.models_def.networks import catalog
from camkit.models_def.sensors import sensor_choice
from tests.installed_package import Points, installed
from tests.lab_package import PACKAGE

POINTS: Points = {
    catalog.GROUP: {"lab_plain": "tests.lab_package.networks:PlainNetwork", "lab_bad": "math:pi"},
    sensor_choice.GROUP: {"LAB-1": "tests.lab_package.sensors:LAB_1", "LAB-2": "math:pi"},
    psf_source.GROUP: {"lab": "tests.lab_package.readers:read_lab", "bad": "math:pi"},
}


@pytest.fixture(scope="module")
def lab_installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Install the package for a module."""
    with installed(tmp_path_factory.mktemp("site"), PACKAGE, POINTS):
        yield
