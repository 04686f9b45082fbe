import numpy as np
import pytest

from camkit.errors import DecodeError
from camkit.runtime.files.dng.dng_checks import check_dng, find_doubts, states_cells
from camkit.runtime.files.raw_checks import Levels
from camkit.runtime.files.tiff_tags import TiffTags

GOOD = {
    256: (80,),
    257: (60,),
    273: (8,),
    258: (16,),
    259: (1,),
    262: (32803,),
    277: (1,),
    279: (9600,),
    33421: (2, 2),
    50706: (1, 4, 0, 0),
    50713: (2, 2),
    50714: (256, 256, 256, 256),
    50717: (4095,),
}
LEVELS = Levels(black=np.full((2, 2), 256, dtype=np.float32), white=4095.0)


def check(change=None, *, remove=(), cfa="RGGB", levels=LEVELS):
    directory = {tag: v for tag, v in (GOOD | (change or {})).items() if tag not in remove}
    check_dng(TiffTags(directories=(directory,), file_bytes=20000), cfa, levels)


def test_a_dng_that_agrees_with_itself_passes():
    check()
    check({50714: (256,)}, remove=(50713,))
    check(remove=(50713, 50714), levels=Levels(black=LEVELS.black * 0, white=4095.0))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({262: (1,)}, None),
        ({257: (61,)}, "uncompressed"),
        ({258: (14,)}, "uncompressed"),
        ({279: (9000,)}, "uncompressed"),
        ({50714: (512,)}, "black"),
        ({50717: (16383,)}, "white"),
    ],
)
def test_contradictions_are_refused(change, message):
    if message is None:
        check(change)  # an unknown kind of picture is still the largest one
        return
    with pytest.raises(DecodeError, match=message):
        check(change)


def test_a_lost_pattern_a_lost_black_and_a_lost_white_are_refused():
    with pytest.raises(DecodeError, match="CFA"):
        check(cfa=None)
    with pytest.raises(DecodeError, match="gives none"):
        check(remove=(50714,))
    with pytest.raises(DecodeError, match="16 bits"):
        check(remove=(50717,), levels=Levels(black=LEVELS.black, white=65536.0))
    with pytest.raises(DecodeError, match="no sensor picture"):
        check(remove=(256, 262))


def test_levels_that_libraw_rescales_are_not_compared():
    check({258: (8, 8, 8), 259: (34892,), 50717: (255,), 50714: (256,)})
    check({339: (3,), 50717: (1,)})


def test_other_files_are_left_alone():
    check({50717: (1,)}, remove=(50706,))


def doubts(**change):
    directory = GOOD | {int(tag.removeprefix("t")): value for tag, value in change.items()}
    return find_doubts(TiffTags(directories=(directory,), file_bytes=20000))


def test_levels_that_the_caller_says_are_not_compared():
    said = Levels(black=np.full((2, 2), 90, dtype=np.float32), white=1023.0)
    tags = TiffTags(directories=(GOOD,), file_bytes=20000)
    check_dng(tags, "RGGB", said, frozenset({"black", "white"}))
    with pytest.raises(DecodeError, match="white"):
        check_dng(tags, "RGGB", said, frozenset({"black"}))


def test_a_sound_layout_raises_no_doubt():
    assert doubts() == []
    assert doubts(t278=(20,), t273=(8, 3208, 6408), t279=(3200,) * 3) == []
    assert doubts(t322=(48,), t323=(32,), t324=(1, 2, 3, 4)) == []
    assert doubts(t259=(34892,), t50712=(0, 100, 4000)) == []
    assert doubts(t50829=(4, 8, 60, 80), t50719=(2, 2), t50720=(68, 52)) == []
    assert doubts(t50829=(3, 5, 60, 80), t50719=(1, 3), t50720=(67, 51)) == []
    assert doubts(t256=(79,), t257=(59,), t279=(9322,)) == []
    assert find_doubts(TiffTags(directories=({256: (9,), 257: (7,)},), file_bytes=9)) == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"t278": (20,), "t273": (8, 3208)}, "need 3 strip(s), there are 2"),
        ({"t322": (48,), "t323": (60,), "t324": (1, 2, 3)}, "need 2 tile(s), there are 3"),
        ({"t279": (9640,)}, "no whole number"),
        ({"t50829": (4, 8, 61, 80)}, "active area (4, 8, 61, 80) leaves"),
        ({"t50829": (4, 8, 4, 80)}, "active area"),
        ({"t50829": (4, 8, 60, 80), "t50720": (73, 56)}, "crop (73, 56) at (0.0, 0.0) leaves"),
        ({"t50719": (20, 0), "t50720": (70, 60)}, "crop"),
        ({"t259": (34892,)}, "curve is missing"),
        ({"t322": (0,), "t323": (60,), "t324": (1,)}, "tile of 0x60 pixels holds nothing"),
        ({"t50712": (0, 900, 100, 4095)}, "samples falls"),
        ({"t50717": (65536,)}, "white 65536 does not fit in 16 bits"),
        ({"t50712": (0, 100, 2000), "t50717": (4095,)}, "the table of the samples ends at 2000"),
        ({"t259": (7,), "t277": (2,)}, "one sample in each pixel, not 2"),
    ],
)
def test_a_layout_that_contradicts_its_size_is_named(change, message):
    (doubt,) = doubts(**change)
    assert message in doubt
    assert doubt.endswith("the header is damaged")


def test_a_mosaic_whose_place_in_the_file_is_not_said_is_named():
    lost = {tag: value for tag, value in GOOD.items() if tag not in (273, 50706)}
    (doubt,) = find_doubts(TiffTags(directories=(lost,), file_bytes=20000))
    assert "does not say where the pixels" in doubt


def test_any_file_may_state_that_its_sensor_has_cells_of_four():
    arw = {tag: value for tag, value in GOOD.items() if tag != 50706}
    assert states_cells(TiffTags(directories=(arw,), file_bytes=1))
    for change in ({33421: (6, 6)}, {262: (34892,)}):
        assert not states_cells(TiffTags(directories=(arw | change,), file_bytes=1))
