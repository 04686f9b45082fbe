"""A camera as ONNX graphs in a folder: what another program needs to run it, and nothing of camkit.

    bundle -> facts -> graphs + portable.safetensors + portable.json

`docs/guides/portable.md` is the contract; `examples/` holds readers.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from safetensors.numpy import save

from camkit.bundle.reader import Bundle
from camkit.errors import ContractError
from camkit.runtime.bank.blocks import BORDER_SHARE
from camkit.runtime.capture import SATURATION_SHARE
from camkit.runtime.geometry.resampling import FLOOR, WHITE
from camkit.runtime.portable.block import block_graph
from camkit.runtime.portable.demosaic_taps import MARGIN_PX
from camkit.runtime.portable.facts import CameraFacts, facts_of
from camkit.runtime.portable.folder import check_target, write_files
from camkit.runtime.portable.graph_builder import GraphBuilder, shared_tables
from camkit.runtime.portable.haze_graph import cells_graph, haze_graph
from camkit.runtime.portable.place import place_graph
from camkit.runtime.portable.spans_graph import noise_graph, spans_graph
from camkit.runtime.portable.tile import kept_graph, tile_graph
from camkit.runtime.portable.warp_graph import TILE_PX, places_graph, warp_graph
from camkit.units import MM_PER_M

PORTABLE_VERSION: Final = 1
HAZE_VERSION: Final = 2
"""Of cameras whose blocks need what the graphs `cells` and `haze` find; others stay what they are."""
MANIFEST: Final = "portable.json"
TABLES: Final = "portable.safetensors"
TILE_HALOS: Final = 12
"""Of a side of a tile, where a reader chooses none; with fewer more is computed twice."""


def write_portable(
    bundle: Bundle,
    out: Path,
    sizes: tuple[str, ...] | None = None,
    *,
    depth_mm: float | None = None,
) -> Mapping[str, int]:
    """Write a camera as graphs, tables and a manifest: all of them or none.

    Args:
        bundle: Of the camera.
        out: A new or empty folder, or a new file of the type .zip.
        sizes: Of the network; None for all that the bundle holds.
        depth_mm: Object distance whose kernels the graphs take; None for the mean over all.

    Returns:
        Bytes of every file by its name.

    Raises:
        UnsupportedError: If the camera has no such graphs; the message names why.
        ContractError: If a size or distance is unknown, or something lies at `out`.
    """
    check_target(out)
    facts = facts_of(bundle, depth_mm)
    bundle_sizes = bundle.manifest.sizes
    used_sizes = bundle_sizes if sizes is None else sizes
    if unknown := [size for size in used_sizes if size not in bundle_sizes]:
        raise ContractError(f"{bundle.manifest.name} has no size {unknown[0]}; got {bundle_sizes}")
    graphs = _graphs(facts, used_sizes)
    files = {f"{graph.name}.onnx": graph.to_bytes() for graph in graphs}
    files[TABLES] = save(dict(shared_tables(graphs)))
    document = portable_manifest(facts, graphs, used_sizes)
    files[MANIFEST] = (json.dumps(document, indent=1) + "\n").encode()
    write_files(out, files)
    return {name: len(data) for name, data in files.items()}


def _graphs(facts: CameraFacts, sizes: tuple[str, ...]) -> list[GraphBuilder]:
    kinds = (False, True) if facts.bank.mosaic is not None else (False,)
    places = [place_graph(facts, mosaic=mosaic) for mosaic in kinds]
    lights = (False, True) if facts.bank.clip_iterations else (False,)
    blocks = [block_graph(facts, mosaic=mosaic, lights=lit) for mosaic in kinds for lit in lights]
    tiles = [tile_graph(facts, size) for size in sizes]
    warps = [places_graph(facts), *(warp_graph(facts, limited=one) for one in (False, True))]
    first = [noise_graph(facts), spans_graph(facts)]
    if facts.haze is not None:
        first += [cells_graph(facts.haze), haze_graph(facts.haze)]
    return [*first, *places, *blocks, kept_graph(), *tiles, *warps]


def portable_manifest(
    facts: CameraFacts, graphs: list[GraphBuilder], sizes: tuple[str, ...]
) -> dict[str, Any]:
    """Return the numbers of `portable.json`."""
    manifest, sensor, bank = facts.bundle.manifest, facts.sensor, facts.bank
    extent = sensor.known_extent
    networks = {}
    for size in sizes:
        one = facts.bundle.network_facts(facts.network.role, size)
        reach = one.reach_px + facts.network.extra_reach_px
        stride = one.stride_px
        halo = -(-reach // stride) * stride
        networks[size] = {
            "graph": f"tile_{size}",
            "halo_px": halo,
            "stride_px": stride,
            "tile_px": TILE_HALOS * max(halo, stride),
        }
    return {
        "portable_version": PORTABLE_VERSION if facts.haze is None else HAZE_VERSION,
        "camera": {
            "name": manifest.name,
            "version": manifest.version,
            "licence": manifest.licence,
            "bundle_sha256": facts.bundle.sha256,
        },
        "sensor": {
            "size_px": [extent.width_px, extent.height_px],
            "pitch_mm": facts.pitch_mm,
            "axis_px": list(facts.axis_px),
            "cfa": sensor.cfa,
            "red_px": [sensor.cfa.index("R") % 2, sensor.cfa.index("R") // 2],
            "black_level": sensor.black_level,
            "white_level": sensor.white_level,
            "clip_share": SATURATION_SHARE,
            "noise": [one.model_dump(mode="json") for one in sensor.noise],
        },
        "bank": {
            "block_px": bank.block_px,
            "overlap_px": bank.overlap_px,
            "border_px": int(bank.overlap_px * BORDER_SHARE),
            "step_px": bank.block_px - bank.overlap_px,
            "margin_px": MARGIN_PX,
            "mirrors": facts.kernels.turns,
            "mosaic_within_mm": None if bank.mosaic is None else bank.mosaic.within_mm,
            "lights": bank.clip_iterations > 0,
            "depth_m": None if facts.depth_mm is None else facts.depth_mm / MM_PER_M,
        },
        "haze": None if facts.haze is None else {"cell_px": facts.haze.kernels.cell_px},
        "networks": networks,
        "warp_px": TILE_PX,
        "warp_white": WHITE,
        "warp_floor": FLOOR,
        "agrees": {
            "lights": bank.whole_blocks,
            "places": facts.warp.places == "fixed",
        },
        "tables": TABLES,
        "common": [graph.name for graph in graphs if not graph.name.startswith("tile_")],
        "graphs": {
            graph.name: {
                "file": f"{graph.name}.onnx",
                "inputs": graph.inputs,
                "tables": list(graph.tables),
                "outputs": graph.outputs,
            }
            for graph in graphs
        },
    }
