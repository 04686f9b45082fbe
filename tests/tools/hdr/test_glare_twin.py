"""The two-point star: its share, its angle, its two arms; the light itself stays whole."""

import math
from pathlib import Path

import numpy as np
import pytest

from camkit.runtime.raw import read_capture
from tools.hdr.glare_twin import (
    Fading,
    exposed_scene,
    main,
    photographed,
    psnr_db,
    two_point_star,
)


@pytest.mark.parametrize("fading", ["exponential", "even"])
def test_the_star_has_two_equal_arms_of_the_stated_share_and_angle(fading: Fading) -> None:
    angle = math.radians(5)
    kernel = two_point_star(angle, fading).dense()[0, 0].astype(np.float64)
    middle = kernel.shape[0] // 2
    assert kernel[middle, middle] == 1
    arms = kernel.copy()
    arms[middle, middle] = 0
    assert arms.sum() == pytest.approx(0.06, rel=0.03)
    np.testing.assert_allclose(arms, arms[::-1, ::-1], atol=1e-7)
    y, x = np.mgrid[-middle : middle + 1, -middle : middle + 1]
    lower = y > 8
    mean = (arms * x)[lower].sum() / (arms * y)[lower].sum()
    assert math.atan(mean) == pytest.approx(angle, abs=math.radians(0.1))


def test_clean_optics_leave_noise_alone() -> None:
    scene = exposed_scene("night:6", 64, 80)
    shot = photographed(scene, None)
    assert 45 < psnr_db(shot.picture, shot, 0.9) < 56
    assert shot.picture.max() == 1


def test_a_photograph_and_its_truth_are_written_and_nothing_is_replaced(tmp_path: Path) -> None:
    seen, truth = tmp_path / "seen.exr", tmp_path / "truth.exr"
    words = ["night:6", "-o", str(seen), "--truth", str(truth), "--size-px", "80", "64"]
    main(words)
    pictures = [read_capture(path).samples.astype(np.float64) for path in (seen, truth)]
    assert [picture.shape for picture in pictures] == [(3, 64, 80)] * 2
    assert pictures[0].mean() > 1.01 * pictures[1].mean()
    with pytest.raises(SystemExit, match=r"written as new files in \.exr; got .*seen\.exr"):
        main(words)
