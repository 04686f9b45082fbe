"""An overview: means of squares, lights counted in full pixels, whatever the bands."""

import numpy as np

from camkit.runtime.kinds.hdr.deglare import overview as module
from camkit.runtime.kinds.hdr.deglare.overview import overview_of


def test_squares_are_means_and_lights_are_shares() -> None:
    picture = np.zeros((3, 1540, 4), np.float32)
    picture[:, :2, :2] = [[[9.0]], [[0.5]], [[0.1]]]
    picture[1, 2, 3] = 0.9
    found = overview_of(lambda top, bottom: picture[:, top:bottom], 1540, 4, 0.9)
    assert found.square_px == 3
    assert found.light.shape == (513, 1)
    # the brightest colour counts as white: (1 + 0.5 + 0.1) / 3 over four of nine pixels
    np.testing.assert_allclose(found.light[0, 0], 4 / 9 * 1.6 / 3, rtol=1e-6)
    np.testing.assert_allclose(found.lights[0, 0], 4 / 9, rtol=1e-6)
    assert not found.lights[1:].any()


def test_bands_change_no_bit(monkeypatch: object) -> None:
    picture = np.random.default_rng(1).random((3, 900, 20), dtype=np.float32)
    whole = overview_of(lambda top, bottom: picture[:, top:bottom], 900, 20, 0.9)
    monkeypatch.setattr(module, "ROWS_AT_ONCE", 3)  # type: ignore[attr-defined]
    parts = overview_of(lambda top, bottom: picture[:, top:bottom], 900, 20, 0.9)
    np.testing.assert_array_equal(whole.light, parts.light)
    np.testing.assert_array_equal(whole.lights, parts.lights)
