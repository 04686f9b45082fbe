"""Colour filter arrays: the four Bayer patterns, and the colour at each pixel."""

from typing import Final, Literal, get_args

from camkit.errors import ContractError

CfaPattern = Literal["RGGB", "BGGR", "GRBG", "GBRG"]
CFA_PATTERNS: Final[tuple[CfaPattern, ...]] = get_args(CfaPattern)


def cfa_channels(cfa: CfaPattern) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return the colour index (0 R, 1 G, 2 B) at each position of the 2x2 cell.

    Args:
        cfa: Letters in reading order of the cell whose corner is pixel (0, 0).
    """
    if cfa not in CFA_PATTERNS:
        raise ContractError(f"CFA must be one of {', '.join(CFA_PATTERNS)}; got {cfa!r}")
    index = ["RGB".index(letter) for letter in cfa]
    return (index[0], index[1]), (index[2], index[3])


def shifted_cfa(cfa: CfaPattern, origin_px: tuple[int, int]) -> CfaPattern:
    """Return the pattern that a crop of a mosaic begins with.

    Args:
        cfa: Letters in reading order of the cell whose corner is pixel (0, 0) of the sensor.
        origin_px: (x, y) of the first pixel of the crop.
    """
    x, y = origin_px
    letters = "".join(cfa[(y + dy) % 2 * 2 + (x + dx) % 2] for dy in (0, 1) for dx in (0, 1))
    return next(pattern for pattern in CFA_PATTERNS if pattern == letters)
