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
from camkit.bundle.sensor import SpadSensor
from camkit.errors import ContractError
from camkit.psf import depth_name
from camkit.runtime.bank.blocks import BORDER_SHARE
from camkit.runtime.capture import SATURATION_SHARE
from camkit.runtime.geometry.resampling import FLOOR, WHITE
from camkit.runtime.portable.block import block_graph
from camkit.runtime.portable.demosaic_taps import MARGIN_PX
from camkit.runtime.portable.facts import CameraFacts, facts_of
from camkit.runtime.portable.folder import check_target, write_files
from camkit.runtime.portable.frames_graph import fine_stage, frame_graphs, frames_manifest
from camkit.runtime.portable.graph_builder import GraphBuilder, shared_tables
from camkit.runtime.portable.haze_graph import cells_graph, haze_graph
from camkit.runtime.portable.place import place_graph
from camkit.runtime.portable.spans_graph import noise_graph, spans_graph
from camkit.runtime.portable.tile import kept_graph, tile_graph
from camkit.runtime.portable.warp_graph import TILE_PX, places_graph, warp_graph

PORTABLE_VERSION: Final = 1
KINDS_VERSION: Final = 2
"""Of cameras that programs for version 1 cannot run: with a haze, or of another kind than Bayer."""
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
    manifest = bundle.manifest
    is_array = isinstance(manifest.sensor, SpadSensor)
    facts = None if is_array else facts_of(bundle, depth_mm)
    bundle_sizes = tuple(manifest.networks[fine_stage(bundle).role]) if is_array else manifest.sizes
    used_sizes = bundle_sizes if sizes is None else sizes
    if unknown := [size for size in used_sizes if size not in bundle_sizes]:
        raise ContractError(f"{manifest.name} has no size {unknown[0]}; got {bundle_sizes}")
    if facts is None:
        if depth_mm is not None:
            raise ContractError(f"{manifest.name} has no kernels by distance; leave it out")
        graphs, numbers = frame_graphs(bundle, used_sizes), frames_manifest(bundle, used_sizes)
    else:
        graphs, numbers = _graphs(facts, used_sizes), _bayer_numbers(facts, used_sizes)
    document = portable_manifest(bundle, graphs, numbers)
    files = {f"{graph.name}.onnx": graph.to_bytes() for graph in graphs}
    files[TABLES] = save(dict(shared_tables(graphs)))
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
    bundle: Bundle, graphs: list[GraphBuilder], numbers: dict[str, Any]
) -> dict[str, Any]:
    """Return `portable.json`.

    Args:
        bundle: Of the camera.
        graphs: All that are written.
        numbers: Of its kind.
    """
    manifest = bundle.manifest
    one_size = {network["graph"] for network in numbers["networks"].values()}
    is_old = manifest.kind == "bayer" and numbers["haze"] is None
    return {
        "portable_version": PORTABLE_VERSION if is_old else KINDS_VERSION,
        "kind": manifest.kind,
        "camera": {
            "name": manifest.name,
            "version": manifest.version,
            "licence": manifest.licence,
            "bundle_sha256": bundle.sha256,
        },
        **numbers,
        "tables": TABLES,
        "common": [graph.name for graph in graphs if graph.name not in one_size],
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


def _bayer_numbers(facts: CameraFacts, sizes: tuple[str, ...]) -> dict[str, Any]:
    """Return the numbers of `portable.json` of a Bayer camera."""
    sensor, bank = facts.sensor, facts.bank
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
            "distance": None if facts.depth_mm is None else depth_name(facts.depth_mm),
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
    }
