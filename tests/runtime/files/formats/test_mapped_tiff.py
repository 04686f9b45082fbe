"""Large plain TIFF files are read in place and give what decoding gives."""

from pathlib import Path

import numpy as np
import pytest
import tifffile

from camkit.runtime.capture import Capture, MosaicOptions
from camkit.runtime.files import picture
from camkit.runtime.files.formats import mapped_tiff, tiff_picture
from camkit.runtime.files.formats.mapped_tiff import map_plain_tiff
from camkit.runtime.machine.memory import mapping_of, release_pages

RNG = np.random.default_rng(0)
MOSAIC = RNG.integers(60, 1000, (50, 36)).astype(np.uint16)
COLORS = RNG.integers(0, 65535, (50, 36, 3)).astype(np.uint16)


@pytest.mark.parametrize("samples", [MOSAIC, COLORS, COLORS.astype(np.uint8)])
def test_a_plain_file_is_mapped_and_equals_its_samples(tmp_path: Path, samples: np.ndarray) -> None:
    path = tmp_path / "plain.tif"
    tifffile.imwrite(path, samples)
    mapped = map_plain_tiff(path, least_bytes=0)
    assert mapped is not None
    assert mapping_of(mapped[10:20]) is not None
    np.testing.assert_array_equal(mapped, samples)
    release_pages(mapped)
    np.testing.assert_array_equal(mapped, samples)


@pytest.mark.parametrize(
    "options",
    [
        {"compression": "zlib"},
        {"tile": (16, 16)},
        {"byteorder": ">"},
        {"photometric": "miniswhite"},
        {"rowsperstrip": 7, "compression": "zlib"},
    ],
)
def test_any_other_tiff_is_left_to_the_decoder(tmp_path: Path, options: dict) -> None:
    path = tmp_path / "other.tif"
    tifffile.imwrite(path, MOSAIC, **options)
    assert map_plain_tiff(path, least_bytes=0) is None


def test_float_small_and_foreign_files_are_left_to_the_decoder(tmp_path: Path) -> None:
    path = tmp_path / "float.tif"
    tifffile.imwrite(path, MOSAIC.astype(np.float32))
    assert map_plain_tiff(path, least_bytes=0) is None
    tifffile.imwrite(path, MOSAIC)
    assert map_plain_tiff(path) is None
    path.write_bytes(b"II*\0" + b"\xff" * 40)
    assert map_plain_tiff(path, least_bytes=0) is None
    path.write_bytes(b"no TIFF at all")
    assert map_plain_tiff(path, least_bytes=0) is None


def both_ways(monkeypatch: pytest.MonkeyPatch, read: object, path: Path) -> list[Capture]:
    decoded = read(path)  # type: ignore[operator]
    monkeypatch.setattr(
        tiff_picture, "map_plain_tiff", lambda p: mapped_tiff.map_plain_tiff(p, least_bytes=0)
    )
    return [decoded, read(path)]  # type: ignore[operator]


def test_captures_read_in_place_equal_decoded_ones_and_take_no_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "mosaic.tif"
    tifffile.imwrite(path, MOSAIC)
    options = MosaicOptions(cfa="RGGB", black_level=64, white_level=1023)
    decoded, mapped = both_ways(monkeypatch, lambda p: picture.read_mosaic(p, options), path)
    assert (decoded.resident_bytes, mapped.resident_bytes) == (MOSAIC.nbytes, 0)
    np.testing.assert_array_equal(decoded.linear_rows(3, 40), mapped.linear_rows(3, 40))
    np.testing.assert_array_equal(decoded.saturated_rows(3, 40), mapped.saturated_rows(3, 40))


def test_rgb_read_in_place_equals_decoded_rgb(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "rgb.tif"
    tifffile.imwrite(path, COLORS)
    decoded, mapped = both_ways(monkeypatch, picture.read_picture, path)
    rows = mapped.linear_rows(3, 40)
    assert rows.flags.c_contiguous
    np.testing.assert_array_equal(decoded.linear_rows(3, 40), rows)
    assert mapped.resident_bytes == 0
