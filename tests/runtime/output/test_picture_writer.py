import tracemalloc
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.color import color_stage
from camkit.runtime.geometry.turning import turn
from camkit.runtime.output.picture_writer import Codes, PictureFormat, PictureWriter
from camkit.runtime.output.writer import SUFFIXES, held_bytes, open_writer

STAGE = color_stage(None)


class Collector(PictureWriter):
    """Keeps what it is given."""

    def __init__(self, picture: PictureFormat) -> None:
        super().__init__(Path("nowhere"), picture)
        self.stored: list[Codes] = []
        self.finished = self.released = False

    def encode(self, band: FloatArray) -> Codes:
        return band

    def store(self, rows: Codes) -> None:
        self.stored.append(rows)

    def finish(self) -> None:
        self.finished = True

    def release(self) -> None:
        self.released = True


def collector(**changes: object) -> Collector:
    fields = {"width": 5, "height": 4, "color": STAGE} | changes
    return Collector(PictureFormat(**fields))  # type: ignore[arg-type]


def planes() -> FloatArray:
    return np.arange(60, dtype=np.float32).reshape(3, 4, 5)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_bands_are_turned_as_a_whole(orientation: int) -> None:
    writer = collector(orientation=orientation)
    with writer:
        writer.write(planes()[:, :3])
        writer.write(planes()[:, 3:])
    found = np.concatenate(writer.stored, axis=1)
    np.testing.assert_array_equal(found, turn(planes(), orientation))
    assert writer.picture.file_size == (found.shape[2], found.shape[1])


def test_upright_bands_are_stored_at_once() -> None:
    writer = collector()
    writer.write(planes()[:, :2])
    assert len(writer.stored) == 1


def test_missing_rows_are_an_error() -> None:
    writer = collector()
    writer.write(planes()[:, :2])
    with pytest.raises(ContractError, match="4 rows expected; got 2"):
        writer.close()


@pytest.mark.parametrize("shape", [(3, 5, 5), (3, 2, 4), (1, 2, 5), (3, 5)])
def test_bands_that_do_not_fit_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(ContractError, match="a band must be"):
        collector().write(np.zeros(shape, np.float32))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_invalid_numbers_are_refused(value: float) -> None:
    band = planes()
    band[2, 3, 4] = value
    with pytest.raises(ContractError, match=r"rows 0..4 hold NaN or inf"):
        collector().write(band)


def test_error_in_the_block_releases_without_finishing() -> None:
    writer = collector()
    with pytest.raises(KeyError), writer:
        raise KeyError
    assert writer.released
    assert not writer.finished


@pytest.mark.parametrize(
    "changes", [{"width": 0}, {"height": 0}, {"orientation": 9}, {"jpeg_quality": 0}]
)
def test_impossible_format_is_refused(changes: dict[str, object]) -> None:
    with pytest.raises(ContractError):
        collector(**changes)


@pytest.mark.parametrize("kind", SUFFIXES)
def test_every_format_has_a_writer(tmp_path: Path, kind: str) -> None:
    color = color_stage(None, "camera") if kind == "dng" else STAGE
    facts = PictureFormat(width=5, height=4, color=color)
    with open_writer(tmp_path / "a", kind, facts) as writer:
        writer.write(planes() / 60)
    assert (tmp_path / "a").stat().st_size > 100


def test_unknown_format_is_refused(tmp_path: Path) -> None:
    facts = PictureFormat(width=5, height=4, color=STAGE)
    with pytest.raises(ContractError, match="exr, tiff, png, jpeg, dng for image; got 'bmp'"):
        open_writer(tmp_path / "a", "bmp", facts)


def test_a_product_that_nothing_writes_is_refused(tmp_path: Path) -> None:
    facts = PictureFormat(width=5, height=4, color=STAGE)
    with pytest.raises(ContractError, match="nothing writes 'depth'; there are image"):
        open_writer(tmp_path / "a", "exr", facts, product="depth")


def test_after_an_error_nothing_is_written_any_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """OpenEXR never returns from a call after a failed one."""
    writer = collector()
    calls: list[int] = []

    def fail(rows: Codes) -> None:
        calls.append(rows.shape[1])
        raise OSError("disk full")

    monkeypatch.setattr(writer, "store", fail)
    for _ in range(3):
        with pytest.raises(OSError, match="disk full"):
            writer.write(planes()[:, :2])
    assert calls == [2]


@pytest.mark.parametrize("orientation", [1, 3, 6])
@pytest.mark.parametrize("format_", ["exr", "tiff", "png", "jpeg"])
def test_what_a_writer_holds_is_what_it_says(
    tmp_path: Path, format_: str, orientation: int
) -> None:
    height, width = 768, 1024
    picture = PictureFormat(
        width=width,
        height=height,
        color=STAGE,
        orientation=orientation,
    )
    stated = held_bytes(format_, pixels=height * width, orientation=orientation)
    band = np.full((3, 64, width), 0.3, np.float32)
    tracemalloc.start()
    with open_writer(tmp_path / "a.part", format_, picture) as writer:
        for _ in range(height // 64):
            writer.write(band)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    few_rows = 40 * 128 * width
    assert peak < stated + few_rows


def test_a_turned_picture_beyond_half_is_kept_whole(tmp_path: Path) -> None:
    """The first bands fit half floats, a later one does not."""
    picture = PictureFormat(width=8, height=6, color=STAGE, orientation=6)
    bands = np.full((3, 6, 8), 0.5, np.float32)
    bands[:, 4:] = 1e6
    with open_writer(tmp_path / "a.exr", "exr", picture) as writer:
        writer.write(bands[:, :4])
        writer.write(bands[:, 4:])
    with OpenEXR.File(str(tmp_path / "a.exr")) as file:
        found = file.channels()["RGB"].pixels
    np.testing.assert_array_equal(found[..., 0], turn(bands[0], 6))
