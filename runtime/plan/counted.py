"""The work of a plan, counted: windows of networks as they would be laid, and blocks of the bank.

    tiers of cells -> windows with halos (`cell_windows`) -> megapixels of every size
    no tiers       -> the whole picture, in strips if it is large (`row_network`)
                   -> work against doing everything

Everything is counted for a usual memory cap, so that no plan depends on the caller's.
"""

from typing import Final, NoReturn

import numpy as np

from camkit.arrays import FloatArray
from camkit.runtime.content import CELL_PX
from camkit.runtime.network.cell_windows import CellLimits, CellNetwork, lay_cells
from camkit.runtime.network.tiling import PixelCost
from camkit.runtime.network.windows import STRIPS_FROM_PX
from camkit.runtime.plan.decision import PLAIN, Subject, Work
from camkit.runtime.plan.tiers import BANK_MAC, NETWORK_EVERYWHERE_MAC, network_work

STRIP_RATIO: Final = 1.2
"""Computed over kept pixels of strips (measured with duet at 24 megapixels: S 1.21, M 1.17)."""
USUAL_BYTES: Final = 500_000_000
"""Memory that windows of cells get of the usual cap."""


def counted_window_mp(subject: Subject, work: Work) -> dict[str, float]:
    """Return size -> megapixels that its windows compute, of the one network of a camera."""
    size_px = subject.height_px, subject.width_px
    labels, sizes = work.network_labels(), work.sizes()
    if not sizes:
        return {}
    if labels is None:
        ratio = STRIP_RATIO if size_px[0] * size_px[1] > STRIPS_FROM_PX else 1.0
        return {work.size: ratio * subject.megapixels}
    networks = [_cell_network(subject, size) for size in sizes]
    limits = CellLimits(cell_px=CELL_PX, max_bytes=USUAL_BYTES)
    layout = lay_cells(size_px, labels, networks, limits)
    return {size: layout.area_px(number) / 1e6 for number, size in enumerate(sizes)}


def counted_work(subject: Subject, work: Work) -> float:
    """Return the work of bank and networks, in multiplications per pixel of the capture."""
    filtered = 1.0 if work.labels is None else float(np.mean(work.labels != PLAIN))
    if not work.networks:
        return BANK_MAC * filtered
    network = sum(
        mp * network_work(subject.facts(size).mac_per_pixel)
        for size, mp in counted_window_mp(subject, work).items()
    )
    return BANK_MAC * filtered + NETWORK_EVERYWHERE_MAC + network / subject.megapixels


def _cell_network(subject: Subject, size: str) -> CellNetwork:
    facts = subject.facts(size)
    return CellNetwork(
        run=_run_nothing,
        stride_px=facts.stride_px,
        halo_px=subject.reach_px(size),
        cost=PixelCost(
            arena_bytes=facts.bytes_per_pixel,
            channels=facts.input_channels,
            outputs=facts.output_channels,
        ),
    )


def _run_nothing(_window: FloatArray) -> NoReturn:
    raise AssertionError("windows that are only counted are never run")
