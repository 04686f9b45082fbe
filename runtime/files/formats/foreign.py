"""Formats of pictures that are not read, by how their files begin, so that each is named.

References: ISO/IEC 14496-12 (brands of ftyp: HEIF, AVIF), 18181-2 (JPEG XL), 15444-1 (JPEG 2000);
RFC 9649 (WebP); the signatures that the other formats state.
"""

from typing import Final

from camkit.errors import DecodeError

HEAD_BYTES: Final = 32
_JPEG: Final = b"\xff\xd8\xff"
_STARTS: Final = (
    (b"GIF8", "a GIF"),
    (b"8BPS", "a Photoshop PSD"),
    (b"%PDF", "a PDF"),
    (b"\0\0\0\x0cjP  ", "a JPEG 2000"),
    (b"\xff\x4f\xff\x51", "a JPEG 2000"),
    (b"\0\0\0\x0cJXL ", "a JPEG XL"),
    (b"\xff\x0a", "a JPEG XL"),
    (b"II\xbc\x01", "a JPEG XR"),
    (b"SDPX", "a DPX"),
    (b"XPDS", "a DPX"),
    (b"DDS ", "a DDS"),
    (b"SIMPLE  =", "a FITS"),
    (b"qoif", "a QOI"),
    *((b"P%d" % n + space, "a PNM") for n in range(1, 7) for space in (b"\n", b" ", b"\r", b"\t")),
    *((b"P" + letter + b"\n", "a PFM") for letter in (b"F", b"f")),
)
_BRANDS: Final = {
    b"heic": "a HEIC", b"heix": "a HEIC", b"heim": "a HEIC", b"heis": "a HEIC", b"hevc": "a HEIC",
    b"mif1": "a HEIF", b"msf1": "a HEIF", b"avif": "an AVIF", b"avis": "an AVIF",
    b"qt  ": "a film (QuickTime)", b"isom": "a film (MP4)", b"mp41": "a film (MP4)",
    b"mp42": "a film (MP4)",
}  # fmt: skip


def check_not_foreign(head: bytes) -> None:
    """Refuse a file of a format that is known and not read.

    Args:
        head: Its first `HEAD_BYTES`.

    Raises:
        DecodeError: If it is one; names it.
    """
    name = next((name for start, name in _STARTS if head.startswith(start)), "")
    if head[4:8] == b"ftyp":
        name = _BRANDS.get(head[8:12], "")
    if head.startswith(b"RIFF") and head[8:12] == b"WEBP":
        name = "a WebP"
    if name:
        raise DecodeError(
            f"{name} file is not read; save it as EXR, TIFF or PNG, or give the camera's RAW file"
        )


def check_no_jpeg(head: bytes) -> None:
    """Refuse a JPEG that is named as a RAW file or not at all.

    Raises:
        DecodeError: If it is one.
    """
    if head.startswith(_JPEG):
        raise DecodeError("a JPEG, under another name; call it .jpg if it is meant as a picture")
