"""Decode a RAW file with LibRaw: the module that knows what rawpy gives.

size -> pattern -> levels -> samples, planes of what is no Bayer mosaic by LibRaw's own demosaic
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.cfa import CfaPattern
from camkit.errors import DecodeError
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.files import raw_checks
from camkit.runtime.files.dng import dng_checks
from camkit.runtime.files.dng.applied_tags import SeenPixels, apply_tags
from camkit.runtime.files.dng.picture_tags import DngPicture
from camkit.runtime.files.dng.readable import X_TRANS
from camkit.runtime.files.order.tile_edges import TileGrid
from camkit.runtime.files.raw_decode import RawDecode, stated_orientation
from camkit.runtime.files.raw_metadata import raw_metadata
from camkit.runtime.files.tiff_tags import TiffTags

# LibRaw's flip has three bits (1 mirror columns, 2 mirror rows, 4 transpose); EXIF counts 1..8
FLIP_TO_EXIF: Final = {0: 1, 1: 2, 2: 4, 3: 3, 4: 5, 5: 8, 6: 6, 7: 7}
MASKED_RIM_PX: Final = 2
LEAST_X_TRANS_PX: Final = 512
NOTHING_SAID: Final = MosaicOptions()
DEVELOPED: Final = "not a Bayer mosaic: LibRaw demosaicked it and cut the values below black"


def decode_with_libraw(
    raw: Any, tags: TiffTags, picture: DngPicture | None, options: MosaicOptions
) -> RawDecode:
    """Decode a file with LibRaw, and apply the tags of a DNG that it leaves out.

    Args:
        raw: The file as rawpy opened it.
        tags: Of the file.
        picture: Its sensor picture, if it is a DNG.
        options: Levels that the caller says in place of the file's.

    Raises:
        DecodeError: If LibRaw's answer is not believable.
    """
    sizes = raw.sizes
    raw_checks.check_size(sizes.height, sizes.width, tags.file_bytes)
    raw_checks.check_size(sizes.raw_height, sizes.raw_width, tags.file_bytes)
    notes: list[str] = []
    if abs(sizes.pixel_aspect - 1) > 0.01:
        notes.append(
            f"pixels are not square (aspect {sizes.pixel_aspect:.3f}); the picture is not rescaled"
        )
    cfa = _cfa(raw)
    # black levels are read before any postprocess, which subtracts and overwrites them
    levels = _levels(raw, cfa, options)
    raw_checks.check_levels(levels)
    dng_checks.check_dng(tags, cfa, levels, options.levels)
    if cfa is None and dng_checks.states_cells(tags):
        notes.append("the file states a CFA of 2x2, LibRaw found none: its header is damaged")
    samples, levels = _samples(raw, cfa, levels, notes, options)
    if picture is not None:
        samples, levels = _with_tags(raw, picture, (samples, cfa, levels), options, notes)
    orientation = stated_orientation(tags)
    red, green, blue, *_ = (float(gain) for gain in raw.camera_whitebalance)
    return RawDecode(
        samples=samples,
        cfa=cfa,
        levels=levels,
        orientation=1 if orientation == 1 else FLIP_TO_EXIF.get(sizes.flip, 1),
        metadata=raw_metadata(raw, tags),
        gains=(red, green, blue),
        table_matrix=np.array(raw.rgb_xyz_matrix, dtype=np.float64)[:3],
        masked=_masked(raw),
        grid=_grid(picture, (sizes.top_margin, sizes.left_margin)),
        notes=notes,
    )


def _grid(picture: DngPicture | None, first: tuple[int, int]) -> TileGrid | None:
    if picture is None or not picture.tile_size:
        return None
    return TileGrid(size=picture.tile_size, first=first)


def _with_tags(
    raw: Any,
    picture: DngPicture,
    decoded: tuple[NDArray[Any], CfaPattern | None, raw_checks.Levels],
    options: MosaicOptions,
    notes: list[str],
) -> tuple[NDArray[Any], raw_checks.Levels]:
    """Apply the tags of a DNG, or note them where LibRaw has demosaicked the picture already."""
    samples, cfa, levels = decoded
    if samples.ndim == 3 and DEVELOPED in notes:
        notes += dng_checks.unapplied(picture)
        return samples, levels
    pixels = SeenPixels(
        samples=samples,
        cfa=cfa,
        whole=raw.raw_image if raw.raw_image is not None else np.empty((0, 0)),
        first=(raw.sizes.top_margin, raw.sizes.left_margin),
    )
    samples, levels, more = apply_tags(
        picture, pixels, options, levels if picture.is_rescaled else None
    )
    notes += more
    return samples, levels


def _cfa(raw: Any) -> CfaPattern | None:
    """Return the 2x2 cell at the first visible pixel; None if the file is no 2x2 mosaic."""
    import rawpy

    pattern = raw.raw_pattern
    if raw.raw_type != rawpy.RawType.Flat or pattern is None or pattern.shape != (2, 2):
        return None
    top, left = raw.sizes.top_margin, raw.sizes.left_margin
    names = raw.color_desc.decode("ascii", errors="replace")
    cell = [raw.raw_color(top + dy, left + dx) for dy in (0, 1) for dx in (0, 1)]
    return raw_checks.check_pattern("".join(names[index] for index in cell))


def _black_level(raw: Any, cfa: CfaPattern | None) -> NDArray[np.float32]:
    """Reorder LibRaw's black levels, which go by colour index, to positions in the cell."""
    by_color = np.array(raw.black_level_per_channel, dtype=np.float32)
    if cfa is None:
        return by_color[:3]
    top, left = raw.sizes.top_margin, raw.sizes.left_margin
    cell = [[raw.raw_color(top + dy, left + dx) for dx in (0, 1)] for dy in (0, 1)]
    return np.asarray(by_color[np.array(cell)])


def _levels(raw: Any, cfa: CfaPattern | None, options: MosaicOptions) -> raw_checks.Levels:
    """Return the levels of the file where the caller says no others."""
    black, white = _black_level(raw, cfa), float(raw.white_level)
    if options.black_level is not None:
        black = np.full_like(black, options.black_level)
    return raw_checks.Levels(
        black=black, white=white if options.white_level is None else options.white_level
    )


def _masked(raw: Any) -> list[NDArray[Any]]:
    """Return the areas left of and above the picture, which see no light; not their rims."""
    import rawpy

    if raw.raw_type != rawpy.RawType.Flat:
        return []
    top, left, whole = raw.sizes.top_margin, raw.sizes.left_margin, raw.raw_image
    rim = MASKED_RIM_PX
    return [whole[top:, rim : max(left - rim, rim)], whole[rim : max(top - rim, rim)]]


def _samples(
    raw: Any,
    cfa: CfaPattern | None,
    levels: raw_checks.Levels,
    notes: list[str],
    options: MosaicOptions,
) -> tuple[NDArray[Any], raw_checks.Levels]:
    """Return the samples, as far as possible in LibRaw's own memory, and their levels."""
    import rawpy

    stacked = raw.raw_type == rawpy.RawType.Stack
    if cfa is not None:
        return raw.raw_image_visible, levels
    if stacked and raw.num_colors == 3:
        notes.append("linear RGB file: already demosaicked, so demosaicking is skipped")
        return np.moveaxis(raw.raw_image_visible[..., :3], -1, 0), levels
    if not stacked and raw.num_colors == 1:
        notes.append("monochrome sensor: its plane is used as red, green and blue")
        plane = raw.raw_image_visible
        return np.broadcast_to(plane, (3, *plane.shape)), levels
    return develop_linear(raw, notes, options)


def develop_linear(
    raw: Any, notes: list[str], options: MosaicOptions = NOTHING_SAID
) -> tuple[NDArray[Any], raw_checks.Levels]:
    """Demosaic with LibRaw what is no Bayer mosaic (X-Trans, sRAW, four colours).

    Returns:
        (3, h, w) uint16 in camera space without white balance, and black 0, white 65535.

    Raises:
        DecodeError: If it is an X-Trans picture that is too small for LibRaw.
    """
    import rawpy

    height, width = raw.sizes.height, raw.sizes.width
    if np.shape(raw.raw_pattern) == X_TRANS and min(height, width) < LEAST_X_TRANS_PX:
        raise DecodeError(
            f"LibRaw demosaics X-Trans from {LEAST_X_TRANS_PX}x{LEAST_X_TRANS_PX} px on; got "
            f"{width}x{height}"
        )
    picture = raw.postprocess(
        output_color=rawpy.ColorSpace.raw,
        gamma=(1, 1),
        output_bps=16,
        no_auto_bright=True,
        adjust_maximum_thr=0.0,
        user_wb=[1.0, 1.0, 1.0, 1.0],
        user_flip=0,
        user_black=None if options.black_level is None else round(options.black_level),
        user_sat=None if options.white_level is None else round(options.white_level),
    )
    notes.append(DEVELOPED)
    black = np.zeros(3, dtype=np.float32)
    return np.moveaxis(picture, -1, 0), raw_checks.Levels(black=black, white=65535.0)
