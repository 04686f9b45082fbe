"""Read pictures: linear captures (EXR, 16-bit TIFF/PNG), headerless mosaics, sharp scenes.

    read_picture      a capture that is already a picture (linear_rgb_v1)
    read_mosaic       a single-channel PNG or TIFF that is a Bayer mosaic
    read_scene        a sharp scene for the simulation, as linear Rec.709
    read_light        the same as light, which is never negative
    read_scene_and_space  the same with the colour space that the file states
    read_orientation  how a file says that its samples are to be turned
    read_samples      the samples of a picture that is no photograph, as they are stored

Samples stay as they are stored; an EXIF orientation is told beside them. The decoders of the
formats lie in `camkit.runtime.files.formats`.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.caller import option_text
from camkit.colorimetry import apply_matrix
from camkit.errors import DecodeError
from camkit.runtime.capture import Capture, MosaicOptions
from camkit.runtime.files import raw_checks
from camkit.runtime.files.exif_tags import exif_of_picture, metadata_of, orientation_of
from camkit.runtime.files.formats import exr_picture, foreign, jpeg_segments
from camkit.runtime.files.formats.color_space import SRGB, ColorSpace, power_curve
from camkit.runtime.files.formats.decoded import Decoded
from camkit.runtime.files.formats.opencv_picture import decode_picture
from camkit.runtime.files.formats.tiff_picture import decode_tiff
from camkit.runtime.files.raw_tags import SensorPlace
from camkit.runtime.files.tiff_tags import TiffTags, read_tiff_tags
from camkit.runtime.files.white_level import check_said_white
from camkit.runtime.metadata import Metadata
from camkit.runtime.signal.tone_curve import AS_STATED, PictureReading, Tone

COUNTS_SUFFIXES: Final = (".tif", ".tiff")
FAINT: Final = 0.01
"""Negative samples up to this share of the brightest are noise."""
MOSAIC_RATIO: Final = 1.5
"""Differences of neighbours over those of next neighbours, along rows and columns, from which on
single samples are taken for a mosaic; of pictures it is below 1, of noise 1."""
_MOST_EIGHT: Final = 255
_STEADY: Final = 0.5
"""Share of what the sites of a cell differ by that is the same in every cell, of a mosaic; dithered
pictures alternate too, but not always alike."""
_TESTED_PX: Final = 1024
_LINEAR_ROWS: Final = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class _Picture:
    """A decoded file with what it says of its photograph."""

    decoded: Decoded
    orientation: int = 1
    metadata: Metadata = field(default_factory=Metadata)
    place: SensorPlace = field(default_factory=SensorPlace)


def read_picture(path: Path, reading: PictureReading = AS_STATED) -> Capture:
    """Read a picture as a linear capture; grey becomes three equal channels.

    Float samples and those of more than 8 bits are taken as linear. Those of 8 bits are decoded
    from the colour space that the file states, else from sRGB. A tone curve says otherwise. NaN and
    infinite samples are kept and counted in the notes.

    Raises:
        DecodeError: If the file is damaged, of a kind that is not read, or a mosaic; if a tone
            curve is for samples that are light, or colours come from a grey camera.
        OSError: If it cannot be read.
    """
    picture = _decode(path)
    decoded = picture.decoded
    notes = [*decoded.notes]
    if decoded.samples.ndim == 2 and not (reading.is_grey or _begins(path, exr_picture.MAGIC)):
        notes += _grey_notes(path, decoded.samples)
    samples, white, light_notes = _light(decoded, reading)
    channels, channel_notes = _channels(samples, is_grey=reading.is_grey)
    return Capture(
        samples=channels,
        cfa=None,
        black_level=np.zeros(len(channels), dtype=np.float32),
        white_level=white,
        orientation=picture.orientation,
        camera=picture.metadata.camera,
        metadata=picture.metadata,
        window=decoded.window,
        rounding=None if reading.keep_codes else _rounding(decoded, reading.tone),
        notes=(*notes, *light_notes, *channel_notes),
        **picture.place.facts,
    )


def _light(decoded: Decoded, reading: PictureReading) -> tuple[NDArray[Any], float, list[str]]:
    """Return samples of light or kept codes, their white level, and notes on what they mean."""
    samples, tone, is_eight = decoded.samples, reading.tone, 0 < decoded.top <= _MOST_EIGHT
    if is_eight and reading.keep_codes:
        return _full_codes(decoded), 255.0, _notes_on_eight(decoded, keep_codes=True)
    if tone is not None:
        if not decoded.top and not tone.is_linear:
            raise DecodeError(
                "the samples are floats, which are light and not codes; leave "
                f"{option_text('tone')} out"
            )
        notes = _notes_on_tone(decoded, tone)
        if decoded.top and not tone.is_linear:
            return _linear_codes(decoded, _space_of(tone)), 65535.0, notes
        return samples, float(decoded.top or 1), [*notes, *_notes_on_floats(decoded)]
    if is_eight:
        codes = _linear_codes(decoded, decoded.space or SRGB)
        return codes, 65535.0, _notes_on_eight(decoded, keep_codes=False)
    notes = [*_notes_on_floats(decoded), *_notes_on_linear(decoded)]
    return samples, float(decoded.top or 1), notes


def _space_of(tone: Tone) -> ColorSpace:
    """Return the colour space of a tone curve; its primaries are those of Rec.709."""
    return ColorSpace(name=tone.name, curves=(tone.light_at,), to_rec709=np.eye(3))


def _channels(samples: NDArray[Any], *, is_grey: bool) -> tuple[NDArray[Any], list[str]]:
    """Return samples as (c, h, w), and notes.

    Raises:
        DecodeError: If they have colours, and the camera has not.
    """
    if samples.ndim == 2:
        return (samples[None] if is_grey else np.broadcast_to(samples, (3, *samples.shape))), []
    if not is_grey:
        return samples, []
    if not (samples[1:] == samples[:1]).all():
        raise DecodeError(
            "expected a grey picture, as the camera of this bundle takes them, and got one with "
            f"colours; convert it to grey, or choose another {option_text('bundle')}"
        )
    return samples[:1], ["three equal channels: read as a grey picture"]


def _rounding(decoded: Decoded, tone: Tone | None) -> FloatArray | None:
    """Return (2, code - 1) light between codes of few bits, and the variance of rounding there."""
    if not 0 < decoded.top <= _MOST_EIGHT:
        return None
    space = (decoded.space or SRGB) if tone is None else _space_of(tone)
    codes = np.arange(decoded.top + 1, dtype=np.uint8)[None]
    light = np.sort(space.light_of(codes, decoded.top)[0])
    return np.stack([(light[1:] + light[:-1]) / 2, np.diff(light) ** 2 / 12])


def _grey_notes(path: Path, samples: NDArray[Any]) -> list[str]:
    """Return notes on a single channel.

    Raises:
        DecodeError: If it is a mosaic, as its pixels show.
    """
    if _begins(path, jpeg_segments.MAGIC):
        return []
    if _is_mosaic(samples):
        raise DecodeError(
            "expected a picture, got a single channel whose pixels alternate as those of a mosaic "
            f"do; {mosaic_advice()}"
        )
    if np.issubdtype(samples.dtype, np.floating):
        return ["single channel: read as a grey picture"]
    counted = f"; {_counts_advice()}" if path.suffix.lower() in COUNTS_SUFFIXES else ""
    return [f"single channel: read as a grey picture; {mosaic_advice()}{counted}"]


def _is_mosaic(samples: NDArray[Any]) -> bool:
    """Return whether neighbours differ more than next neighbours do, both ways and always alike."""
    top, left = (max(0, (side - _TESTED_PX) // 4 * 2) for side in samples.shape)
    middle = samples[top : top + _TESTED_PX, left : left + _TESTED_PX].astype(np.float32)
    if min(middle.shape) < 3:
        return False
    for plane in (middle, middle.T):
        near, next_ = (float(np.abs(plane[step:] - plane[:-step]).mean()) for step in (1, 2))
        # a sensor's samples are never without noise, as those of a drawn checkerboard are
        if not (next_ > 0 and near > MOSAIC_RATIO * next_):
            return False
    high, wide = (side // 2 * 2 for side in middle.shape)
    cells = middle[:high, :wide].reshape(high // 2, 2, wide // 2, 2)
    offsets = cells - cells.mean(axis=(1, 3), keepdims=True)
    steady = np.abs(offsets.mean(axis=(0, 2))).mean()
    return bool(steady > _STEADY * np.abs(offsets).mean())


def _linear_codes(decoded: Decoded, space: ColorSpace) -> NDArray[np.uint16]:
    """Return light of codes in 16 bits, cut to 0..1."""
    samples = decoded.samples
    codes = np.empty(samples.shape, dtype=np.uint16)
    for top in range(0, samples.shape[-2], _LINEAR_ROWS):
        rows = np.s_[..., top : top + _LINEAR_ROWS, :]
        light = space.light_of(samples[rows], decoded.top)
        codes[rows] = np.round(np.clip(light, 0, 1) * 65535)
    return codes


def _full_codes(decoded: Decoded) -> NDArray[np.uint8]:
    """Return codes of up to 8 bits in the whole range of 8."""
    if decoded.top == _MOST_EIGHT:
        return np.asarray(decoded.samples, dtype=np.uint8)
    table = np.round(np.arange(decoded.top + 1) * (_MOST_EIGHT / decoded.top)).astype(np.uint8)
    return np.asarray(table[decoded.samples])


def _notes_on_eight(decoded: Decoded, *, keep_codes: bool) -> list[str]:
    space, doubt = decoded.space, decoded.doubt
    if doubt:
        return [f"the file states {doubt}, which is ignored: codes are read as sRGB"]
    if space is not None and not space.is_srgb and keep_codes:
        return [f"colour space {space.name!r} is not applied: codes are merged as they are"]
    if keep_codes:
        return []
    name = "sRGB" if space is None or space.is_srgb else repr(space.name)
    return [f"8-bit picture: decoded from {name}; a 16-bit linear file would be more exact"]


def _notes_on_tone(decoded: Decoded, tone: Tone) -> list[str]:
    """Return notes on codes that become light as the caller says."""
    space = decoded.space
    if space is None or (decoded.top and space.means(_space_of(tone))):
        return []
    return [
        f"the file states the colour space {space.name!r}, in place of which codes are read "
        f"by the tone curve {tone.name}"
    ]


def _notes_on_floats(decoded: Decoded) -> list[str]:
    if decoded.top:
        return []
    bad = int(decoded.samples.size - np.count_nonzero(np.isfinite(decoded.samples)))
    return [f"{bad} samples are NaN or infinite"] if bad else []


def _notes_on_linear(decoded: Decoded) -> list[str]:
    """Return notes on a stated space, of which samples that are taken as linear make no use."""
    space, doubt = decoded.space, decoded.doubt
    if decoded.window is not None:
        return [exr_picture.NOT_REC709] if space is not None else []
    if doubt:
        return [f"the file states {doubt}, which is ignored: samples are read as linear light"]
    is_plain = space is None or (
        space.tables is None and space.is_rec709 and space.has_curve(power_curve(1.0))
    )
    if is_plain or space is None:
        return []
    return [f"colour space {space.name!r} is not applied: samples are read as linear light"]


def read_mosaic(path: Path, options: MosaicOptions) -> Capture:
    """Read a headerless Bayer mosaic from a single-channel PNG or TIFF.

    Raises:
        DecodeError: If the file is damaged, a JPEG, has several channels, or contradicts the
            options.
        OSError: If it cannot be read.
    """
    if _begins(path, jpeg_segments.MAGIC):
        raise DecodeError(
            f"{path.name} is a JPEG, which cannot be a mosaic: its tones are coded; give "
            "RAW files, or a PNG or TIFF of the sensor's own samples"
        )
    picture = _decode(path)
    samples, top = picture.decoded.samples, picture.decoded.top
    if samples.ndim != 2 or not top:
        raise DecodeError(
            "a headerless mosaic must have one 8- or 16-bit channel, or packed bits; got "
            f"{samples.dtype} {samples.shape}; omit the mosaic options for an RGB picture"
        )
    if options.black_level is None or options.white_level is None:
        raise DecodeError(f"levels without a CFA are for RAW files; {mosaic_advice()}")
    levels = raw_checks.Levels(
        black=np.full((2, 2), options.black_level, dtype=np.float32), white=options.white_level
    )
    raw_checks.check_levels(levels, top)
    check_said_white(samples, levels.white)
    return Capture(
        samples=samples,
        cfa=options.cfa,
        black_level=levels.black,
        white_level=levels.white,
        orientation=picture.orientation,
        camera=picture.metadata.camera,
        metadata=picture.metadata,
        notes=(
            "headerless mosaic: CFA and levels are those of the options",
            *picture.decoded.notes,
        ),
    )


def read_scene(path: Path) -> FloatArray:
    """Read a sharp scene for the simulation, as `read_scene_and_space`.

    Returns:
        (3, h, w) float32 linear Rec.709.

    Raises:
        DecodeError: As `read_scene_and_space`.
    """
    return read_scene_and_space(path)[0]


def read_scene_and_space(path: Path) -> tuple[FloatArray, ColorSpace]:
    """Read a sharp scene, and the colour space that its file states; sRGB where it states none.

    Integer samples are sRGB unless the file states another colour space, float ones (EXR, HDR,
    float TIFF) are linear.

    Returns:
        (3, h, w) float32 linear Rec.709.

    Raises:
        DecodeError: If the file is missing, damaged, states a colour space that cannot be honoured,
            or holds NaN or infinite samples; names it.
    """
    try:
        decoded = _decode(Path(path)).decoded
    except OSError as error:
        raise DecodeError(f"cannot read {path}: {error.strerror or error}") from error
    except DecodeError as error:
        raise DecodeError(f"{path}: {error}") from error
    if decoded.doubt:
        raise DecodeError(f"{path} states {decoded.doubt}; save it as sRGB")
    if decoded.top:
        linear = (decoded.space or SRGB).light_of(decoded.samples, decoded.top)
    else:
        linear = _light_of_floats(path, decoded)
    bad = int(linear.size - np.count_nonzero(np.isfinite(linear)))
    if bad:
        raise DecodeError(f"{path}: {bad} samples are NaN or infinite; a scene must be finite")
    planes = np.stack([linear] * 3) if linear.ndim == 2 else np.ascontiguousarray(linear)
    return planes, decoded.space or SRGB


def _light_of_floats(path: Path, decoded: Decoded) -> FloatArray:
    """Return float samples in Rec.709."""
    linear, space = np.asarray(decoded.samples, dtype=np.float32), decoded.space
    if space is None or space.is_srgb:
        return linear
    if space.tables is not None or not space.has_curve(power_curve(1.0)):
        raise DecodeError(
            f"{path} is of floats, but its colour space {space.name!r} is of codes; save 16 bits"
        )
    return linear if linear.ndim == 2 else apply_matrix(space.to_rec709, linear)


def read_light(path: Path) -> FloatArray:
    """Read a sharp scene whose faint negative samples are taken as dark.

    Noise leaves samples a little below 0 in linear files, and colours outside Rec.709 are below 0
    in its primaries alone. What lies deeper than `FAINT` of the brightest sample in the file's own
    primaries is no such thing and stays, for others to refuse.

    Returns:
        (3, h, w) float32 linear Rec.709.

    Raises:
        DecodeError: As `read_scene`.
    """
    scene, space = read_scene_and_space(path)
    from_rec709 = np.linalg.inv(space.to_rec709).astype(np.float64)
    native = scene if space.is_rec709 else apply_matrix(from_rec709, scene)
    if native.min() >= -FAINT * native.max():
        np.maximum(scene, 0, out=scene)
    return scene


def read_orientation(path: Path) -> int:
    """Return the EXIF orientation 1..8 that a file states, 1 where it states none.

    Raises:
        OSError: If it cannot be read.
    """
    if _begins(path, exr_picture.MAGIC):
        return 1
    tags = read_tiff_tags(path)
    return orientation_of(tags if tags.directories else exif_of_picture(path.read_bytes()))


def read_samples(path: Path) -> Decoded:
    """Return the samples of a picture as they are stored, whatever they mean.

    Raises:
        DecodeError: If the file is damaged or of a kind that is not read.
        OSError: If it cannot be read.
    """
    return _decode(path).decoded


def mosaic_advice() -> str:
    """Return the advice about a picture that may be a headerless mosaic."""
    return (
        f"if it is a Bayer mosaic, add {option_text('cfa', 'RGGB')} with "
        f"{option_text('black_level')} and {option_text('white_level')} (RGGB, BGGR, GRBG or GBRG "
        "at the top-left pixel)"
    )


def _counts_advice() -> str:
    return f"if it counts single photons, add {option_text('product', 'intensity')} or depth"


def _begins(path: Path, magic: bytes) -> bool:
    return _head(path).startswith(magic)


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(foreign.HEAD_BYTES)


def _decode(path: Path) -> _Picture:
    foreign.check_not_foreign(_head(path))
    if _begins(path, exr_picture.MAGIC):
        decoded, metadata, place = exr_picture.decode_exr(path)
        return _Picture(decoded=decoded, metadata=metadata, place=place)
    tags = read_tiff_tags(path)
    if tags.directories:
        raw_checks.check_chunks_inside(tags)
        return _of_tags(decode_tiff(path, tags), tags)
    data = path.read_bytes()
    exif = exif_of_picture(data)
    return _of_tags(decode_picture(data, exif), exif)


def _of_tags(decoded: Decoded, tags: TiffTags) -> _Picture:
    return _Picture(decoded=decoded, orientation=orientation_of(tags), metadata=metadata_of(tags))
