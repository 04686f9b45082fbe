"""The blur that photographs were taken with comes back; what they do not show is said."""

from dataclasses import replace
from functools import lru_cache, partial

import pytest

from camkit.calibration.blur.blur_facts import FREQUENCIES
from camkit.calibration.blur.blur_measurement import BlurOptions, measure_blur
from camkit.errors import ContractError, DecodeError
from camkit.runtime.metadata import Metadata
from tests.camkit.calibration.blur_factory import photograph, transfer_of

NUMBER = FREQUENCIES.index(0.2)
REACH_PX = 8.0


@lru_cache
def taken(seed):
    return photograph(seed)


@lru_cache
def measured():
    photos = [(f"{seed}.dng", partial(taken, seed)) for seed in range(3)]
    return measure_blur(photos, BlurOptions(reach_px=REACH_PX))


def test_transfer_comes_back_where_edges_show_it():
    result = measured()
    shown = [one for one in result.heights if min(one.edges[0], one.edges[2]) >= 5]
    assert len(shown) >= 2
    for one in shown:
        share = one.height_mm / (0.5 * (320**2 + 480**2) ** 0.5 * 0.005)
        for colour, wider in enumerate((1.1, 1.0, 1.0)):
            expected = transfer_of(share, 0.2, wider)
            assert one.transfer[colour, :, NUMBER] == pytest.approx(expected, abs=0.035)


def test_held_out_edges_are_predicted_to_two_percent():
    held_out = measured().held_out
    assert held_out.edges >= 20
    assert held_out.percent < 2.0
    assert held_out.percent < 1.1 * held_out.gaussian_percent


def test_kernels_are_a_psf_with_an_uncertainty():
    result = measured()
    assert result.psf.symmetry == "radial"
    assert result.psf.kernels.shape[1:3] == (1, 3)
    assert result.psf.field_heights_mm[0] == 0
    assert result.uncertainty.width >= 0.02
    assert any("not determined" in note for note in result.notes)


def test_photographs_without_edges_are_refused():
    blank = replace(taken(0), samples=(taken(0).samples * 0 + 20000).astype("uint16"))
    with pytest.raises(DecodeError, match="show 0 straight edges"):
        measure_blur([("blank.dng", lambda: blank)], BlurOptions(reach_px=REACH_PX))


def test_clipped_photographs_say_so():
    bright = photograph(1, scale=3.0)
    with pytest.raises(DecodeError, match="clipped: expose less"):
        measure_blur([("bright.dng", lambda: bright)], BlurOptions(reach_px=REACH_PX))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"metadata": Metadata(f_number=8.0)}, "differ in f-number"),
        ({"metadata": Metadata(focal_length_mm=35.0)}, "differ in focal length"),
        ({"camera": "another"}, "differ in camera"),
        ({"pixel_pitch_um": 4.0}, "differ in pixel pitch"),
        ({"sensor_size_px": (600, 400)}, "differ in size of the sensor"),
    ],
)
def test_photographs_of_several_cameras_or_settings_are_refused(change, words):
    # a corner of it is searched for edges in no time
    corner = replace(taken(0), samples=taken(0).samples[:64, :64])
    photos = [("a.dng", lambda: corner), ("b.dng", lambda: replace(corner, **change))]
    with pytest.raises(DecodeError, match=words):
        measure_blur(photos, BlurOptions(reach_px=REACH_PX))


def test_pixels_of_unknown_pitch_are_refused():
    unknown = replace(taken(0), pixel_pitch_um=None)
    with pytest.raises(ContractError, match="states no pixel pitch"):
        measure_blur([("a.dng", lambda: unknown)], BlurOptions(reach_px=REACH_PX))


@pytest.mark.parametrize("options", [{"reach_px": 3.0}, {"pixel_pitch_um": 0.0}, {"depth_m": -1.0}])
def test_options_out_of_range_are_refused(options):
    with pytest.raises(ContractError):
        BlurOptions(**options)
