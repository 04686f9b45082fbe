"""Whatever the tags of a RAW file hold, reading them gives a value, a doubt or a `DecodeError`."""

import contextlib
import math

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from camkit.errors import DecodeError
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.files import raw_checks, raw_tags
from camkit.runtime.files.dng import dng_checks, white_point
from camkit.runtime.files.dng.applied_tags import SeenPixels, apply_tags
from camkit.runtime.files.dng.picture_tags import sensor_picture
from camkit.runtime.files.dng.readable import check_readable
from camkit.runtime.files.exif_tags import metadata_of
from camkit.runtime.files.tiff_tags import TiffTags

KNOWN = (
    *(254, 256, 257, 258, 259, 262, 270, 271, 272, 273, 277, 278, 279, 322, 323, 324, 325, 339),
    *(33421, 33422, 33434, 34855, 50706, 50708, 50710, 50712, 50713, 50714, 50717, 50719, 50720),
    *(50721, 50722, 50727, 50728, 50778, 50779, 50829, 51009, 51041),
    *(284, 317, 50715, 50716, 50723, 50729, 50830, 51008, 51022, 50975),
)
NUMBERS = st.one_of(
    st.sampled_from([0, 1, 2, 3, 4, 255, 32803, 34892, 65535, 2**32 - 1, 2**64 - 1, -1]),
    st.sampled_from([math.nan, math.inf, -math.inf, 1e300, 0.5]),
    st.integers(0, 9000),
)
VALUES = st.one_of(
    st.lists(NUMBERS, min_size=1, max_size=9).map(tuple),
    st.binary(min_size=1, max_size=12),
    st.just(b'{"camkit": {"origin_px": [1e999, "x"], "bundle": []}}'),
)
SOUND = {
    256: (80,),
    257: (60,),
    258: (16,),
    259: (1,),
    262: (32803,),
    273: (400,),
    277: (1,),
    278: (60,),
    279: (9600,),
    33421: (2, 2),
    50706: (1, 4, 0, 0),
    50714: (64,),
    50717: (1023,),
    50719: (0, 0),
    50720: (80, 60),
    50829: (0, 0, 60, 80),
}
CHANGES = st.dictionaries(st.sampled_from(KNOWN), VALUES, max_size=5)
DIRECTORIES = st.lists(
    st.one_of(CHANGES.map(lambda tags: SOUND | tags), CHANGES), min_size=1, max_size=2
)
LEVELS = raw_checks.Levels(black=np.full((2, 2), 64, np.float32), white=1023.0)


@settings(max_examples=100, deadline=None)
@given(directories=DIRECTORIES)
@example(directories=[SOUND | {50714: (math.inf, -math.inf)}])
def test_no_tags_end_in_anything_but_values_doubts_and_refusals(directories):
    tags = TiffTags(directories=tuple(directories), file_bytes=5000, starts=(8, 300))
    for check in (
        lambda: raw_checks.check_chunks_inside(tags),
        lambda: dng_checks.check_dng(tags, "RGGB", LEVELS),
    ):
        with contextlib.suppress(DecodeError):
            check()
    assert all(doubt.endswith("damaged") for doubt in dng_checks.find_doubts(tags))
    picture = sensor_picture(tags)
    if picture is not None:
        samples = np.full((60, 80), 700, dtype=np.uint16)
        samples[0] = 900
        seen = SeenPixels(samples=samples, cfa="RGGB", whole=samples, first=(0, 0))
        with contextlib.suppress(DecodeError):
            check_readable(picture)
        if picture.planes == 1:
            _, levels, notes = apply_tags(picture, seen, MosaicOptions())
            assert np.isfinite(levels.black).all()
            assert all("\n" not in note for note in notes)
    grey = white_point.neutral(tags)
    assert grey is None or (np.isfinite(grey).all() and grey.min() > 0)
    assert raw_tags.sample_bits(tags) in range(17)
    noise, matrix = raw_tags.noise_profile(tags, "RGGB"), white_point.color_matrix(tags)
    assert noise is None or min(*noise.shot, *noise.read_variance) >= 0
    assert matrix is None or np.isfinite(matrix[0]).all()
    place = raw_tags.sensor_place(tags)
    assert place.origin_px is None or min(place.origin_px) >= 0
    metadata = metadata_of(tags)
    assert raw_tags.camera_name(tags, metadata).isprintable()
    assert all(math.isfinite(v) for v in metadata.to_json().values() if not isinstance(v, str))
