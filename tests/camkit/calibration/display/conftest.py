"""A camera before a screen."""

import pytest

from tests.camkit.calibration.display.screen_factory import Booth


@pytest.fixture
def booth_of():
    """Make one for a screen; sizes and faults as keywords."""

    def make(screen, **change):
        return Booth(screen=(screen.width_px, screen.height_px), **change)

    return make
