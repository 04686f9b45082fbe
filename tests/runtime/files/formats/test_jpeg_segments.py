"""A JPEG ends where its last scan does, whatever lies behind it or in its headers."""

import io

import numpy as np
import pytest
from PIL import Image

from camkit.errors import DecodeError
from camkit.runtime.files.formats.jpeg_segments import end_of_jpeg
from camkit.runtime.files.picture import read_picture
from camkit.runtime.raw import read_capture
from tests.data_folder import data_path

RNG = np.random.default_rng(3)
PICTURE = Image.fromarray(RNG.integers(0, 255, (48, 64, 3), dtype=np.uint8)).resize((128, 96))


def jpeg(picture=PICTURE, **options):
    file = io.BytesIO()
    picture.save(file, "JPEG", **({"quality": 90} | options))
    return file.getvalue()


def exif_with_thumbnail():
    exif = Image.Exif()
    exif[271] = "Maker"
    return exif.tobytes() + jpeg(PICTURE.resize((32, 24)))


KINDS = {
    "baseline": {},
    "progressive": {"progressive": True},
    "restarts": {"restart_marker_blocks": 3},
    "progressive restarts": {"progressive": True, "restart_marker_rows": 1},
    "thumbnail": {"exif": exif_with_thumbnail()},
    "420": {"subsampling": 2},
    "comment": {"comment": b"\xff\xd9\xff\xda"},
}
FILM = b"\0\0\0\x18ftypmp42" + RNG.integers(0, 256, 200_000, dtype=np.uint8).tobytes()
BEHIND = {
    "film": FILM,
    "second picture": jpeg(PICTURE.resize((40, 30))),
    "zeros": bytes(100_000),
    "text": b"SEFH trailer" * 1000,
    "FF": b"\xff" * 70_000,
    "end marker far behind": bytes(70_000) + b"\xff\xd9",
}


@pytest.mark.parametrize("behind", BEHIND)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mode", ["RGB", "L"])
def test_what_lies_behind_a_jpeg_changes_nothing(tmp_path, kind, behind, mode):
    data = jpeg(PICTURE.convert(mode), **KINDS[kind])
    (tmp_path / "a.jpg").write_bytes(data)
    (tmp_path / "b.jpg").write_bytes(data + BEHIND[behind])
    assert end_of_jpeg(data + BEHIND[behind]) == len(data)
    plain, longer = (read_picture(tmp_path / name) for name in ("a.jpg", "b.jpg"))
    assert np.array_equal(plain.samples, longer.samples)
    assert plain.notes == longer.notes


def test_the_motion_picture_of_reports_is_read():
    found, plain = (read_capture(data_path(f"reports/jpeg_{n}.jpg")) for n in ("motion", "plain"))
    assert np.array_equal(found.samples, plain.samples)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("share", [0.0, 0.02, 0.3, 0.6, 0.9, 0.999])
@pytest.mark.parametrize("behind", [b"", jpeg(PICTURE.resize((40, 30)))], ids=["", "and another"])
def test_a_jpeg_that_is_cut_off_is_refused(tmp_path, kind, share, behind):
    data = jpeg(**KINDS[kind])
    path = tmp_path / "a.jpg"
    path.write_bytes(data[: int(share * len(data))] + behind)
    if share == 0 and behind:
        return
    with pytest.raises(DecodeError):
        read_picture(path)


def test_fill_bytes_before_markers_are_skipped():
    data = jpeg()
    assert end_of_jpeg(data[:2] + b"\xff\xff" + data[2:-2] + b"\xff\xff\xff\xd9") == len(data) + 4


@pytest.mark.parametrize("mode", ["CMYK"])
def test_inks_are_refused_by_name(tmp_path, mode):
    (tmp_path / "a.jpg").write_bytes(jpeg(PICTURE.convert(mode)))
    with pytest.raises(DecodeError, match="a CMYK JPEG is not read"):
        read_picture(tmp_path / "a.jpg")


@pytest.mark.parametrize(
    ("marker", "bits", "words"),
    [(0xC1, 12, "12 bits"), (0xC3, 8, "lossless"), (0xF7, 8, "JPEG-LS"), (0xC5, 8, "hierarchical")],
)
def test_other_kinds_of_jpeg_are_refused_by_name(tmp_path, marker, bits, words):
    data = bytearray(jpeg())
    at = data.index(b"\xff\xc0")
    data[at + 1], data[at + 4] = marker, bits
    (tmp_path / "a.jpg").write_bytes(data)
    with pytest.raises(DecodeError, match=words):
        read_picture(tmp_path / "a.jpg")
