import json
import math

import pytest

from camkit.noise import NoiseModel
from camkit.runtime.files import raw_tags
from camkit.runtime.files.exif_tags import metadata_of
from camkit.runtime.files.raw_tags import SensorPlace
from camkit.runtime.files.tiff_tags import TiffTags


def tags_of(**values):
    directory = {int(name[1:]): value for name, value in values.items()}
    return TiffTags(directories=(directory,), file_bytes=1)


def test_one_noise_pair_holds_for_all_colours():
    noise = raw_tags.noise_profile(tags_of(t51041=(1e-4, 1e-7)), "RGGB")
    assert noise == NoiseModel(shot=(1e-4,) * 3, read_variance=(1e-7,) * 3)


def test_three_noise_pairs_follow_the_plane_colours():
    values = (1.0, 10.0, 2.0, 20.0, 3.0, 30.0)
    plain = raw_tags.noise_profile(tags_of(t51041=values), None)
    assert plain.shot == (1, 2, 3)
    for planes in (bytes((2, 1, 0)), (2, 1, 0)):
        noise = raw_tags.noise_profile(tags_of(t51041=values, t50710=planes), None)
        assert (noise.shot, noise.read_variance) == ((3, 2, 1), (30, 20, 10))
    assert raw_tags.noise_profile(tags_of(t51041=values, t50710=(1, 1, 0)), None) is None


def test_four_noise_pairs_follow_the_cell():
    values = (1.0, 10.0, 2.0, 20.0, 3.0, 30.0, 4.0, 40.0)
    noise = raw_tags.noise_profile(tags_of(t51041=values), "GBRG")
    assert noise.shot == (3, 2.5, 2)
    assert raw_tags.noise_profile(tags_of(t51041=values), None) is None


@pytest.mark.parametrize("values", [(1.0,), (1.0, -1.0), (math.nan, 1.0), (1.0, 1.0) * 2])
def test_unbelievable_noise_is_none(values):
    assert raw_tags.noise_profile(tags_of(t51041=values), "RGGB") is None


def test_camera_is_the_unique_model_or_make_and_model():
    def named(**values):
        tags = tags_of(**values)
        return raw_tags.camera_name(tags, metadata_of(tags))

    assert named(t50708=b"Duet\0", t271=b"X", t272=b"Y") == "Duet"
    assert named(t271=b"Canon", t272=b"Canon EOS 6D") == "Canon EOS 6D"
    assert named(t271=b"SONY", t272=b"ILCE-7RM3") == "SONY ILCE-7RM3"
    assert named() == ""


def place(record, model=b""):
    return raw_tags.sensor_place(tags_of(t270=json.dumps(record).encode(), t50708=model))


def test_the_place_on_the_sensor_comes_from_the_description():
    record = {
        "bundle": "duet",
        "origin_px": [0, 5],
        "sensor_size_px": [6000, 4000],
        "pixel_pitch_um": 5.96,
    }
    assert place({"camkit": record}) == SensorPlace(
        bundle_name="duet", origin_px=(0, 5), sensor_size_px=(6000, 4000), pixel_pitch_um=5.96
    )


@pytest.mark.parametrize(
    "record",
    [
        {"origin_px": [-1, 0]},
        {"origin_px": [1.5, 0]},
        {"origin_px": [1]},
        {"origin_px": "12"},
        {"sensor_size_px": [0, 1]},
        {"pixel_pitch_um": -1},
        {"pixel_pitch_um": "5"},
        {"bundle": 7},
    ],
)
def test_odd_values_of_the_description_become_none(record):
    assert place({"camkit": record}) == SensorPlace()


@pytest.mark.parametrize("record", [{}, {"camkit": 1}, [], "text", {"camkit": []}])
def test_other_descriptions_name_no_place(record):
    assert place(record) == SensorPlace()
    assert raw_tags.sensor_place(tags_of()) == SensorPlace()


def test_the_model_names_the_bundle_where_the_description_does_not():
    assert place({}, b"camkit duet").bundle_name == "duet"
    assert place({}, b"camkit derived 24MP").bundle_name is None
    assert place({"camkit": {"bundle": "other"}}, b"camkit duet").bundle_name == "other"
