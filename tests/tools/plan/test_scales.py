"""The accuracy of smaller scales is that of the picture averaged to their size."""

import numpy as np
import pytest

from tools.plan.scales import psnr_db


def test_a_smaller_picture_is_judged_against_the_averages_of_the_sharp_one() -> None:
    sharp = np.full((3, 160, 160), 1.0, np.float32)
    sharp[:, ::2] = 0.0
    assert psnr_db(np.full((3, 80, 80), 0.5, np.float32), sharp) > 100
    off = np.full((3, 160, 160), 1.0, np.float32)
    assert psnr_db(off, sharp) == pytest.approx(10 * np.log10(2), abs=1e-6)
