"""The tiny camera, opened once for all tests of the runtime."""

import pytest

from camkit.bundle.reader import Bundle, open_bundle
from tests.bundle_factory import write_tiny_bundle


@pytest.fixture(scope="session")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    """Give a Bayer camera of 96x64 pixels with all stages."""
    return open_bundle(write_tiny_bundle(tmp_path_factory.mktemp("bundle")))
