"""Work and memory of the coarse band of optics with a haze, known before it is computed."""

from typing import Final

from camkit.bundle.stages import Dehaze
from camkit.haze import Haze
from camkit.runtime.bank.cell_means import cell_count
from camkit.runtime.bank.haze import CORE_TERMS, MARGIN_CELLS
from camkit.runtime.bank.place_blur import AZIMUTHS, TERMS_AT_ONCE
from camkit.runtime.bank.place_undo import cores_differ, filter_side

BYTES_PER_CELL: Final = 400
"""Of how the cells lie between the nodes, and pictures in cells."""


def coarse_work(entry: Dehaze, channels: int) -> float:
    """Return the transforms per pixel, without the margins of the cells.

    Filters for every place add less than as much again.
    """
    return channels * (entry.terms + CORE_TERMS) * (entry.rounds + 2) / entry.shrink**2


def kept_bytes(entry: Dehaze, haze: Haze, channels: int, kernel_scale: float = 1.0) -> int:
    """Return memory of kept kernels, see `haze.few_of`; arguments as of `solving_bytes`."""
    side = int(haze.kernels.shape[-1] * kernel_scale) + 3
    fields = 2 * haze.kernels.shape[0]
    samples = side**2 * (entry.terms + fields)
    if cores_differ(haze):
        samples += filter_side(side) ** 2 * entry.terms
    return int(4 * samples * channels)


def solving_bytes(
    entry: Dehaze, haze: Haze, channels: int, size_px: tuple[int, int], kernel_scale: float = 1.0
) -> int:
    """Return the memory in which the scene of a capture is found.

    Args:
        entry: The manifest's stage.
        haze: Of the optics.
        channels: Colours.
        size_px: (width, height) of the capture.
        kernel_scale: What the kernels are scaled by.
    """
    side = int(haze.kernels.shape[-1] * kernel_scale) + 3
    sides = [cell_count(length, entry.shrink) + 2 * MARGIN_CELLS for length in size_px]
    cells = sides[0] * sides[1]
    spectrum = (sides[0] + side) * (sides[1] + side)
    nodes = AZIMUTHS * haze.kernels.shape[0]
    # a quarter of all places in every colour, and twice those of one colour while few are found
    places = 4 * nodes * side**2 * (2.25 + channels / 4)
    terms = max(entry.terms, CORE_TERMS)
    blur_bytes = terms * (4 * spectrum + 16 * cells)
    blur_bytes += 4 * spectrum * -(-terms // TERMS_AT_ONCE)
    if cores_differ(haze):
        wide = filter_side(side)
        blur_bytes += entry.terms * (4 * (sides[0] + wide) * (sides[1] + wide) + 16 * cells)
        places += 12 * nodes * wide**2
    # the kernels of all places are gone before few of them are laid over the picture
    most = max(places, blur_bytes + BYTES_PER_CELL * cells)
    return int(kept_bytes(entry, haze, channels, kernel_scale) + most)
