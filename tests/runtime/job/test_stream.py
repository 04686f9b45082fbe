"""A plane on its way: a source or bands, whoever takes it, and nobody changes another's rows."""

from collections.abc import Iterator

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.runtime.clock import StageClock
from camkit.runtime.job.stream import Stream
from camkit.runtime.rows import ArrayRows, Rows
from tests.job_factory import read_all, stream_of

PICTURE = np.random.default_rng(0).random((3, 300, 7), dtype=np.float32)


def _made(rows: int = 40) -> Iterator[Rows]:
    for top in range(0, 300, rows):
        yield PICTURE[:, top : top + rows].copy()


def _streams() -> dict[str, Stream]:
    source = stream_of(PICTURE)
    return {
        "source": source,
        "own source": stream_of(PICTURE.copy(), owned=True),
        "bands": source.with_bands(_made()),
        "shared source": source.shared(2)[0],
        "shared bands": source.with_bands(_made()).shared(3)[1],
    }


@pytest.mark.parametrize("kind", _streams())
def test_rows_pieces_and_bands_are_the_picture(kind: str) -> None:
    np.testing.assert_array_equal(read_all(_streams()[kind].rows(), 33), PICTURE)
    np.testing.assert_array_equal(np.concatenate(list(_streams()[kind].bands()), 1), PICTURE)
    pieced = _streams()[kind].pieced()
    found = [np.concatenate(pieced.pieces(top, top + 50), 1) for top in range(0, 300, 50)]
    np.testing.assert_array_equal(np.concatenate(found, axis=1), PICTURE)


@pytest.mark.parametrize("kind", _streams())
def test_bands_may_be_changed_by_who_reads_them(kind: str) -> None:
    before = PICTURE.copy()
    for band in _streams()[kind].bands():
        np.multiply(band, 2, out=band)
    np.testing.assert_array_equal(PICTURE, before)


def test_takers_may_read_at_their_own_pace_and_change_their_bands() -> None:
    first, second, third = stream_of(PICTURE).with_bands(_made()).shared(3)
    assert not first.owned
    ahead = [band.copy() for band in first.bands()]
    for band in second.bands():
        np.add(band, 1, out=band)
    np.testing.assert_array_equal(np.concatenate(ahead, axis=1), PICTURE)
    np.testing.assert_array_equal(read_all(third.rows(), 17), PICTURE)


def test_one_taker_gets_the_stream_itself_and_none_gets_none() -> None:
    stream = stream_of(PICTURE)
    assert stream.shared(1) == [stream]
    assert stream.shared(0) == []


def test_for_a_taker_that_is_gone_no_row_is_kept() -> None:
    kept, gone = stream_of(PICTURE).with_bands(_made()).shared(2)
    rows = kept.source
    assert rows is not None
    rolling = rows._rows  # type: ignore[attr-defined]
    rows.read(0, 100)
    rows.read(100, 250)
    assert sum(band.shape[1] for _, band in rolling._bands_read) == 280
    del gone
    rows.read(250, 300)
    assert sum(band.shape[1] for _, band in rolling._bands_read) <= 60


def test_a_source_or_bands_but_never_both_or_none() -> None:
    stream = stream_of(PICTURE)
    fields = {"plane": stream.plane, "shape": stream.shape, "gains": stream.gains}
    with pytest.raises(ContractError, match="either"):
        Stream(**fields)  # type: ignore[arg-type]
    with pytest.raises(ContractError, match="either"):
        Stream(**fields, source=ArrayRows(PICTURE), band_iterator=_made())  # type: ignore[arg-type]


def test_only_a_source_of_own_rows_gives_rows_to_change() -> None:
    streams = _streams()
    assert [kind for kind, stream in streams.items() if stream.gives_own_rows] == ["own source"]


@pytest.mark.parametrize("kind", ["source", "bands"])
def test_what_is_read_is_charged_to_its_stage(kind: str) -> None:
    clock = StageClock()
    timed = _streams()[kind].timed(clock, "bank")
    np.testing.assert_array_equal(read_all(timed.rows(), 64), PICTURE)
    assert set(clock.seconds) == {"bank"}


def test_what_a_stage_makes_readable_anywhere_has_the_shape_of_its_rows() -> None:
    made = stream_of(PICTURE).with_source(ArrayRows(PICTURE[:2]))
    assert (made.shape, made.owned) == ((2, 300, 7), True)
