"""A merged picture states what all its frames state: bundle, place on the sensor, camera."""

import re

import numpy as np
import pytest

from camkit.runtime.files.raw_tags import SensorPlace
from camkit.runtime.kind_parts.photograph_facts import describe_photograph
from camkit.runtime.merging.result import merge_to_exr
from camkit.runtime.merging.survey import survey
from camkit.runtime.metadata import Metadata
from camkit.runtime.output.dng import camkit_description, write_bayer_dng
from camkit.runtime.raw import named_bundle, read_capture
from tests.dng_factory import dng_tags, scene_mosaic

TIMES_S = (0.5, 0.125)
PLACE = {
    "bundle": "duet",
    "origin_px": (4, 6),
    "sensor_size_px": (6000, 4000),
    "pixel_pitch_um": 5.96,
    "psf_sha256": "a1" * 32,
}


def _merged(tmp_path, short=None, **metadata):
    """Merge two frames, of which the shorter states something else; return report and capture."""
    files = [tmp_path / "long.dng", tmp_path / "short.dng"]
    for path, time_s in zip(files, TIMES_S, strict=True):
        is_short = path is files[1]
        place = PLACE | (short or {}) if is_short else PLACE
        facts = {"iso": 400.0, "f_number": 2.8, "lens_model": "Duet"}
        facts |= metadata if is_short else {}
        tags = dng_tags(
            description=camkit_description(**place),
            metadata=Metadata(exposure_time_s=time_s, **facts),
        )
        write_bayer_dng(path, (scene_mosaic() * time_s + 256).astype(np.uint16), tags=tags)
    out = tmp_path / "out.exr"
    times_s = TIMES_S if metadata else None
    report = merge_to_exr(survey(files, times_s), out, reference="long.dng")
    return report, out, read_capture(out)


def test_a_merged_picture_is_found_on_the_sensor_as_its_frames_are(tmp_path):
    report, out, capture = _merged(tmp_path)
    expected = PLACE | {"bundle_name": PLACE["bundle"]}
    del expected["bundle"]
    assert SensorPlace.of(capture).facts == expected
    assert named_bundle(out) == "duet"
    facts = capture.metadata.to_json()
    stated = {"iso": 400, "f_number": 2.8, "lens_model": "Duet", "exposure_time_s": 0.5}
    assert facts | stated == facts
    assert describe_photograph(out, None)["origin_px"] == (4, 6)
    assert not [note for note in report.notes if "states" in note]


@pytest.mark.parametrize(
    ("short", "note"),
    [
        ({"origin_px": (8, 6)}, r"long.dng states duet at \(4, 6\) .* short.dng states .*\(8, 6\)"),
        ({"bundle": "trio"}, "short.dng states trio at"),
        ({"psf_sha256": "b2" * 32}, "PSF a1a1a1a1, short.dng .* PSF b2b2b2b2"),
    ],
)
def test_frames_of_several_places_give_a_picture_without_one_and_a_note(tmp_path, short, note):
    report, out, capture = _merged(tmp_path, short)
    assert SensorPlace.of(capture) == SensorPlace()
    assert named_bundle(out) is None
    (line,) = [n for n in report.notes if "states neither bundle nor place" in n]
    assert re.search(note, line)


def test_what_frames_contradict_is_left_out_of_the_metadata(tmp_path):
    report, _, capture = _merged(tmp_path, iso=800.0, lens_model="Trio")
    assert capture.metadata.iso is None
    assert (capture.metadata.lens_model, capture.metadata.f_number) == ("", 2.8)
    assert "frames differ in lens, ISO: the EXR states none" in report.notes
