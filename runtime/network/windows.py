"""The windows of the networks of one capture: windows within the memory cap, then run.

    networks, size, memory [, labels] -> NetworkWindows -> bands

Without labels one network runs everywhere: a large picture in strips of whole rows, segment by
segment (`row_network`), otherwise in windows (`tiling`). With labels it runs on some lattice cells
only (`cell_windows`).
"""

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from camkit.arrays import FloatArray
from camkit.bundle.facts import HaloError, NetworkFacts
from camkit.caller import option_text
from camkit.errors import ContractError, MemoryCapError
from camkit.runtime.cancel import Cancel
from camkit.runtime.network.cell_windows import (
    CellLayout,
    CellLimits,
    CellNetwork,
    Labels,
    infer_cells,
    lay_cells,
)
from camkit.runtime.network.engine import SegmentEngine
from camkit.runtime.network.guard import TileGuard
from camkit.runtime.network.light_keeper import WindowFinish
from camkit.runtime.network.row_network import (
    NetworkRows,
    StripPlan,
    StripWindows,
    plan_strips,
)
from camkit.runtime.network.tiling import (
    BANDS_HELD,
    FLOAT_BYTES,
    PixelCost,
    Progress,
    Run,
    TileLayout,
    TileLimits,
    infer_bands,
    lay_windows,
)
from camkit.runtime.options import Mode
from camkit.runtime.rows import RowSource

FAST_LEAST_DB: Final = 80.0
STRIPS_FROM_PX: Final = 1_500_000
"""Pixels of a picture above which a network runs in strips: below, one window takes no longer."""
STRIP_HEIGHTS_PX: Final = ((96, 128), (48, 96), (1, 64))
"""Rows of a strip, and of the windows of the step behind it, the first that the memory allows."""
STEP_BYTES: Final = 16.0
"""For a pixel of a window, of the step behind a network: its cells, and rows on their way."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SizedNetwork:
    """A network, its size's name and its measured facts.

    Attributes:
        size: Name of its size.
        run: From a window, of which it takes its inputs, to that of its outputs.
        facts: Of the manifest.
        block_bytes: Counted memory of a run per pixel, where the manifest's is not believed.
        masks: Channels that its windows hold besides its inputs, for the step behind it.
        extra_reach_px: Pixels that the step behind it looks beyond its reach.
        lattice_px: Windows keep to multiples of it besides, for the step behind it.
        segments: Returns the network in segments, none if it cannot be cut; None for windows only.
        trim: Called before every strip.
    """

    size: str
    run: Run
    facts: NetworkFacts
    block_bytes: float = 0.0
    masks: int = 0
    extra_reach_px: int = 0
    lattice_px: int = 1
    segments: Callable[[], Sequence[SegmentEngine]] | None = None
    trim: Callable[[], None] = lambda: None

    @property
    def stride_px(self) -> int:
        """Pixels that sides and origins of windows are multiples of."""
        return math.lcm(self.facts.stride_px, self.lattice_px)

    @property
    def cost(self) -> PixelCost:
        """Return the memory of the network per pixel."""
        step_bytes = STEP_BYTES if self.extra_reach_px else 0.0
        return PixelCost(
            arena_bytes=max(self.facts.bytes_per_pixel, self.block_bytes) + step_bytes,
            channels=self.facts.input_channels + self.masks,
            outputs=self.facts.output_channels,
            scale=self.facts.output_scale,
        )

    @property
    def is_global(self) -> bool:
        """Return whether what it gives anywhere depends on the whole of what it takes."""
        return bool(self.facts.global_operators)

    def halo_px(self, mode: Mode) -> int:
        """Return the halo of a mode.

        Raises:
            ContractError: If mode fast is asked of a network without an error curve.
        """
        reach_px = self.facts.reach_px if mode != "fast" else fast_halo_px(self.facts.halo_error)
        return reach_px + self.extra_reach_px


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowLimits:
    """The limits of the windows.

    Attributes:
        cap_bytes: Memory that the process may take.
        spent_bytes: What of it everything but the networks takes.
        mode: exact, fast or whole.
        cell_px: Side of a lattice cell.
        tile_px: Force windows of about this size.
    """

    cap_bytes: int
    spent_bytes: int
    mode: Mode
    cell_px: int
    tile_px: int | None = None

    @property
    def max_bytes(self) -> int:
        """Return the memory left for the windows."""
        return max(self.cap_bytes - self.spent_bytes, 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkWindows:
    """Windows of one capture, ready to run.

    Attributes:
        networks: Those of the layout.
        tiles: One network everywhere; None with cells.
        cells: Networks on their cells; None with tiles.
        mode: Of the windows.
        strips: The network in strips, whose windows are those of the step behind it; None for
            windows that the network is run on.
    """

    networks: tuple[SizedNetwork, ...]
    tiles: TileLayout | None
    cells: CellLayout | None
    mode: Mode
    strips: StripPlan | None = None

    def bands(
        self,
        source: RowSource,
        *,
        progress: Progress | None = None,
        cancel: Cancel | None = None,
        guard: TileGuard | None = None,
        stand_in: slice | None = None,
        finish: WindowFinish | None = None,
    ) -> Iterator[FloatArray]:
        """Yield (k, s rows, s w) of the result from top to bottom."""
        if self.cells is not None:
            cells = _cell_networks(self.networks, self.mode)
            if stand_in is None:
                raise ContractError("cells need planes that stand in where no network runs")
            return infer_cells(
                cells,
                source,
                self.cells,
                progress=progress,
                cancel=cancel,
                guard=guard,
                stand_in=stand_in,
                finish=finish,
            )
        if self.tiles is None:
            raise ContractError("a network needs tiles or cells")
        network, run, rows = self.networks[0], self.networks[0].run, None
        if self.strips is not None and network.segments is not None:
            strips = NetworkRows(network.segments(), source, self.strips, cancel, network.trim)
            facts = network.facts
            ends = source.shape[0], facts.output_channels, facts.output_scale
            rows = StripWindows(strips, self.tiles, ends)
            run = rows.result
        return infer_bands(
            run,
            source,
            self.tiles,
            rows=rows,
            progress=progress,
            cancel=cancel,
            guard=guard,
            scale=network.facts.output_scale,
            finish=finish,
        )

    def notes(self) -> tuple[str, ...]:
        """Return notes on windows of a network that looks at whole pictures."""
        count = self.to_json().get("windows", 0)
        operators = next((one.facts.global_text for one in self.networks if one.is_global), "")
        if count < 2 or not operators:
            return ()
        return (
            f"the network looks at the whole picture ({operators}), and mode {self.mode} processes "
            f"{count} windows separately: brightness or contrast may change between them",
        )

    @property
    def halo_px(self) -> int:
        """Return the largest halo of its networks."""
        return max(network.halo_px(self.mode) for network in self.networks)

    def window_mp(self) -> dict[str, float]:
        """Return size -> megapixels computed, halos included."""
        if self.strips is not None:
            return {self.networks[0].size: self.strips.work_ratio * self.strips.area_px / 1e6}
        if self.tiles is not None:
            layout = self.tiles
            area = layout.window_count * layout.window_height_px * layout.window_width_px
            return {self.networks[0].size: area / 1e6}
        if self.cells is None:
            return {}
        return {n.size: self.cells.area_px(i) / 1e6 for i, n in enumerate(self.networks)}

    def needed_bytes(self) -> int:
        """Estimate the memory: windows with their arenas, rows held, one output band."""
        if self.tiles is not None:
            if self.strips is not None:
                return self.strips.needed_bytes + _finish_bytes(self.tiles, self.networks[0].cost)
            return self.tiles.needed_bytes(self.networks[0].cost)
        if self.cells is None:
            return 0
        return self.cells.needed_bytes([network.cost for network in self.networks])

    def to_json(self) -> dict[str, Any]:
        """Return the windows in a few numbers, for the sidecar."""
        if self.strips is not None:
            return {
                "mode": self.mode,
                "halo_px": 0,
                "windows": 1,
                "strips": len(self.strips.stops),
                "work_ratio": round(self.strips.work_ratio, 3),
            }
        if self.tiles is not None:
            operators = list(self.networks[0].facts.global_operators)
            return {
                "mode": self.mode,
                "halo_px": self.tiles.halo_px,
                "windows": self.tiles.window_count,
                "work_ratio": round(self.tiles.work_ratio, 3),
            } | ({"global_operators": operators} if operators else {})
        if self.cells is None:
            return {}
        height, width = self.cells.size_px
        return {
            "mode": self.mode,
            "halo_px": self.cells.halo_px,
            "windows": self.cells.window_count,
            "work_ratio": {
                size: round(mp * 1e6 / (height * width), 3) for size, mp in self.window_mp().items()
            },
        }


def lay_network(
    size_px: tuple[int, int],
    networks: Sequence[SizedNetwork],
    limits: WindowLimits,
    labels: Labels | None = None,
) -> NetworkWindows:
    """Plan the windows of a capture.

    A network that looks at the whole picture gets it in one window, in mode exact as in mode whole.

    Args:
        size_px: (height, width).
        networks: One, or with labels as many as these name.
        limits: Memory and mode.
        labels: (row, column): 0 none, n the n-th network; None for the first one everywhere.

    Raises:
        MemoryCapError: If the cap is too small; it names one that is enough.
        ContractError: If a network that looks at the whole picture would be tiled in mode exact.
    """
    budget = (
        f"of the cap of {limits.cap_bytes // 10**6} MB everything but the network takes "
        f"{limits.spent_bytes // 10**6} MB; "
    )
    try:
        return _lay_windows(size_px, networks, limits, labels)
    except MemoryCapError as error:
        need = limits.spent_bytes + error.need_bytes
        cure = f": raise {option_text('max_mem_bytes', need)}"
        if limits.mode == "exact" and any(n.is_global and _has_fast(n.facts) for n in networks):
            fast = option_text("mode", "fast")
            cure += f", or use {fast}, which processes windows separately"
        raise MemoryCapError(f"{budget}{error}{cure}", need) from error
    except ContractError as error:
        raise ContractError(f"{budget}{error}") from error


def _lay_windows(
    size_px: tuple[int, int],
    networks: Sequence[SizedNetwork],
    limits: WindowLimits,
    labels: Labels | None,
) -> NetworkWindows:
    network = networks[0] if networks else None
    one_window = limits.mode == "whole" or (
        limits.mode == "exact" and any(one.is_global for one in networks)
    )
    if network is None or (labels is not None and not one_window):
        if labels is None:
            raise ContractError("windows need a network")
        cells = lay_cells(
            size_px,
            labels,
            _cell_networks(networks, limits.mode),
            CellLimits(cell_px=limits.cell_px, max_bytes=limits.max_bytes, tile_px=limits.tile_px),
        )
        return NetworkWindows(networks=tuple(networks), tiles=None, cells=cells, mode=limits.mode)
    tile_limits = TileLimits(
        stride_px=network.stride_px,
        halo_px=network.halo_px(limits.mode),
        cost=network.cost,
        max_bytes=limits.max_bytes,
        tile_px=limits.tile_px,
        whole=one_window,
    )
    if (strips := _lay_strips(size_px, network, limits)) is not None:
        return strips
    if network.is_global and limits.mode == "exact":
        _check_one_window(size_px, network, limits, tile_limits)
    tiles = lay_windows(*size_px, tile_limits)
    return NetworkWindows(networks=tuple(networks), tiles=tiles, cells=None, mode=limits.mode)


def _lay_strips(
    size_px: tuple[int, int], network: SizedNetwork, limits: WindowLimits
) -> NetworkWindows | None:
    """Return strips of a large picture, as high as the memory allows; None for windows."""
    is_large = size_px[0] * size_px[1] > STRIPS_FROM_PX
    if network.segments is None or not is_large or limits.mode == "whole" or limits.tile_px:
        return None
    segments = [engine.segment for engine in network.segments()]
    if not segments:
        return None
    stride = network.stride_px
    padded = tuple(-(-side // stride) * stride for side in size_px)
    for height, finish_height in STRIP_HEIGHTS_PX:
        strips = plan_strips(
            segments,
            (padded[0], padded[1]),
            -(-height // stride) * stride,
            network.cost.channels,
        )
        tile_limits = TileLimits(
            stride_px=stride,
            halo_px=network.extra_reach_px,
            cost=network.cost,
            tile_px=(finish_height, size_px[1]),
        )
        windows = NetworkWindows(
            networks=(network,),
            tiles=lay_windows(*size_px, tile_limits),
            cells=None,
            mode=limits.mode,
            strips=strips,
        )
        if windows.needed_bytes() <= limits.max_bytes:
            return windows
    return None


def _finish_bytes(layout: TileLayout, cost: PixelCost) -> int:
    """Return the memory of the step behind strips: two buffers, cells, pieces on the way."""
    ends = FLOAT_BYTES * (cost.channels + cost.out_values)
    rows = layout.window_height_px * (ends + STEP_BYTES)
    band_px = max(span.stop_px - span.start_px for span in layout.rows)
    return int(
        layout.window_width_px * (rows + BANDS_HELD * band_px * FLOAT_BYTES * cost.out_values)
    )


def _check_one_window(
    size_px: tuple[int, int],
    network: SizedNetwork,
    limits: WindowLimits,
    tile_limits: TileLimits,
) -> None:
    """Refuse to tile a network that looks at the whole picture."""
    layout = lay_windows(*size_px, replace(tile_limits, max_bytes=sys.maxsize))
    window_bytes = layout.needed_bytes(network.cost)
    if layout.window_count == 1 and window_bytes <= limits.max_bytes:
        return
    height, width = size_px
    reason = (
        f"the network looks at the whole picture ({network.facts.global_text}) and cannot be "
        "tiled exactly"
    )
    if layout.window_count > 1:
        raise ContractError(
            f"{reason}: leave out the tile size, which makes {layout.window_count} windows"
        )
    window = f"one window of {width}x{height} px takes {window_bytes // 10**6} MB"
    raise MemoryCapError(f"{reason}: {window}", window_bytes)


def _has_fast(facts: NetworkFacts) -> bool:
    return any(e.psnr_db is None or e.psnr_db >= FAST_LEAST_DB for e in facts.halo_error)


def fast_halo_px(curve: tuple[HaloError, ...], least_db: float = FAST_LEAST_DB) -> int:
    """Return the smallest halo of a measured error curve that keeps `least_db`.

    Raises:
        ContractError: If the bundle carries no curve.
    """
    good = [e.halo_px for e in curve if e.psnr_db is None or e.psnr_db >= least_db]
    if not good:
        raise ContractError("the bundle has no measured halo for mode fast; use mode exact")
    return min(good)


def _cell_networks(networks: Sequence[SizedNetwork], mode: Mode) -> list[CellNetwork]:
    return [
        CellNetwork(
            run=network.run,
            stride_px=network.stride_px,
            halo_px=network.halo_px(mode),
            cost=network.cost,
        )
        for network in networks
    ]
