"""A pair judged: the filter that knows its blur gains, parts and clipped light are left out."""

import json

import cv2
import numpy as np
import pytest

from camkit.bundle.sensor import Extent
from camkit.bundle.stages import Color, Linearise, Repair, Wiener
from camkit.models_def.training.kind import read_recipe
from camkit.runtime.signal.tone_curve import read_tone
from tests.bayer_recipe import planes_text
from tests.developed_pair import BLUR_PX, write_developed_pair
from tests.planes_bundle import planes_sensor, write_planes_bundle
from tests.psf_factory import gaussian_kernel, uniform_psf
from tools.comparison.real_pairs import coded, gain_db, judged_pairs, main, psnr_db


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """A folder with a pair, the recipe of its camera and a bundle that knows the blur."""
    folder = tmp_path_factory.mktemp("real")
    (folder / "recipe.toml").write_text(planes_text(), encoding="utf-8")
    stated = read_recipe(folder / "recipe.toml").sensor
    (folder / "pairs").mkdir()
    write_developed_pair(folder / "pairs", stated)
    psf = uniform_psf(gaussian_kernel(BLUR_PX)[0], channels=3)
    extent = Extent(
        width_px=stated.width_px, height_px=stated.height_px, pixel_pitch_um=psf.pixel_pitch_um
    )
    sensor = planes_sensor(("R", "G", "B"), extent=extent, full_well_e=200_000)
    wiener = Wiener(
        takes=("sound", "unknown"),
        block_px=128,
        overlap_px=48,
        prior_scale=3e-4,
        prior_exponent=2.5,
    )
    stages = (Linearise(), Repair(), wiener, Color(takes=("restored",)))
    write_planes_bundle(folder, stages, sensor=sensor, psf=psf)
    return folder


def judged(home, *more):
    words = [home / "pairs", "--recipe", home / "recipe.toml", "-o", home / "out.json"]
    words += ["--bundle", f"filter={home / 'planes.camkit'}", *more]
    main([str(word) for word in words])
    (result,) = json.loads((home / "out.json").read_text(encoding="utf-8"))["results"]
    return {row["name"]: row for row in result["rows"]}, result


@pytest.fixture(scope="module")
def whole(home):
    return judged(home)


def test_the_filter_gains_over_the_developed_capture(whole):
    rows, result = whole
    assert list(rows) == ["develop", "wiener"]  # there is no network
    assert result["pair"] == "one_l"
    assert rows["develop"]["gain_db"] < -1
    assert abs(rows["develop"]["gain_db"]) > 5 * rows["develop"]["gain_error_db"]
    assert rows["wiener"]["gain_db"] == 0
    assert rows["wiener"]["ssim"] > rows["develop"]["ssim"]


def test_parts_alone_are_judged_and_crops_written(home, whole, capsys):
    rows, result = judged(
        home, "--parts", "300,0,600,400", "--crops", home / "crops", "--crop", "320,200,80,60"
    )
    assert result["parts"] == [[300, 0, 600, 400]]
    assert 0.3 < rows["wiener"]["pixels"] / whole[0]["wiener"]["pixels"] < 0.6
    assert "wiener" in capsys.readouterr().out
    crop = cv2.imread(str(home / "crops" / "one_l-320-200.png"))
    assert crop.shape == (60, 3 * 80 + 2 * 4, 3)


def test_light_that_clipped_is_left_out_with_its_surroundings(home):
    (one,) = judged_pairs(home / "pairs", home / "recipe.toml", ())
    assert not one.counts[40:60, 300:330].any()
    assert not one.counts[34:66, 294:336].any()
    assert not one.counts[:16].any()
    assert one.counts[200:300, 100:500].all()


def test_codes_are_those_of_the_curve(home):
    tone = read_tone(home / "pairs" / "maker.toml")
    codes = np.linspace(0, 1, 11)
    np.testing.assert_allclose(coded(tone.light_at(codes), tone), codes, atol=2e-3)
    assert coded(np.array([3.0]), tone) == 1


def test_gain_of_tiles_that_all_gain_alike_has_no_error():
    tiles = np.array([[1e-3, 100.0], [4e-3, 100.0], [2e-3, 50.0]])
    halved = tiles * [0.5, 1.0]
    gain, error = gain_db(halved, tiles)
    assert gain == pytest.approx(10 * np.log10(2))
    assert error == pytest.approx(0, abs=1e-9)
    assert psnr_db(tiles) == pytest.approx(-10 * np.log10(7e-3 / 250))
