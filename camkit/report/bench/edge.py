"""The sharpness of a camera, by one slanted edge that its twin photographs: MTF of every method.

edge -> twin on the axis, through the bundle's own PSF -> capture             -> MTF
                                                       -> picture of a method -> MTF

Frequencies are those of the picture, also of a capture that is coarser. The edge is drawn by the
area of its pixels; its own MTF stands beside, and what is above it is invented.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.golden import IMAGE
from camkit.bundle.manifest import Manifest
from camkit.bundle.reader import Bundle
from camkit.cfa import cfa_channels
from camkit.errors import CamkitError
from camkit.report.bench.accuracy import Key, Restorers, score_key
from camkit.report.bench.known_captures import KnownCapture, known_capture
from camkit.report.bench.part import BenchPart
from camkit.report.bench.trial import Skip, Trial
from camkit.report.edge_mtf import edge_mtf
from camkit.report.edge_profile import BINS_PER_PX
from camkit.report.kind_finder import find_part
from camkit.report.quality import Shot
from camkit.runtime.twin.truth import picture_scale
from camkit.scenes.slanted_edge import slanted_edge

CYCLES_PER_PX: Final = (0.25, 0.5)
COLUMNS: Final = ("mtf_025", "mtf_050")
CAPTURE: Final = "capture_"
SCENE: Final = "scene_"
PREFIXES: Final = ("", CAPTURE, SCENE)
LEVELS: Final = (0.2, 0.8)
"""4 : 1, as ISO 12233 has it; as bright as leaves room for overshoot."""
SIDE_PX: Final = 256
REACH_PX: Final = 64
"""Lenses of great depth spread light so wide."""
CUT_PX: Final = 32
"""Beyond its border the scene is mirrored, and the edge has a kink there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Edges:
    """MTF of one camera by one edge.

    Attributes:
        shared: Columns that all its rows have: of the scene and of the capture.
        by_method: `score_key` -> columns of the picture.
        skips: What could not be measured.
    """

    shared: Mapping[str, float] = field(default_factory=dict)
    by_method: Mapping[Key, Mapping[str, float]] = field(default_factory=dict)
    skips: tuple[Skip, ...] = ()

    def columns(self, key: Key) -> dict[str, float | None]:
        """Return all columns of a row; None for what was not measured."""
        values = {**self.shared, **self.by_method.get(key, {})}
        return {
            f"{prefix}{name}": values.get(f"{prefix}{name}")
            for prefix in PREFIXES
            for name in COLUMNS
        }


def measure_edges(bundle: Bundle, trials: Iterable[Trial], restorers: Restorers) -> Edges:
    """Photograph an edge and measure it in the capture and in the picture of every method.

    Args:
        bundle: The camera; without optics or picture nothing is measured.
        trials: Of that camera.
        restorers: Of that camera.
    """
    manifest = bundle.manifest
    if not manifest.has_kernels or IMAGE not in manifest.products:
        return Edges()
    try:
        scale = picture_scale(manifest)
        scene = _draw_edge(manifest, scale)
        known_capture = _photographed(bundle, scene)
        shared = _edge_columns(SCENE, scene[1], 1)
    except CamkitError as error:
        return Edges(skips=(Skip(f"MTF of {manifest.name}", str(error)),))
    skips = []
    try:
        shared |= _of_capture(known_capture, manifest, scale)
    except CamkitError as error:
        skips.append(Skip(f"MTF of the capture of {manifest.name}", str(error)))
    by_method: dict[Key, dict[str, float]] = {}
    for trial in trials:
        key = score_key(trial)
        if key in by_method:
            continue
        by_method[key] = {}
        try:
            picture = restorers.restore(trial, known_capture)[IMAGE]
            by_method[key] = _edge_columns("", picture[len(picture) // 2], 1)
        except CamkitError as error:
            skips.append(Skip(f"MTF of {trial.bundle} {trial.label}", str(error)))
    return Edges(shared=shared, by_method=by_method, skips=tuple(skips))


def _draw_edge(manifest: Manifest, scale: int) -> NDArray[np.float32]:
    """Return the edge; it runs along the longer side, where it shows more."""
    extent = manifest.sensor.extent
    most = (SIDE_PX, SIDE_PX) if extent is None else (extent.height_px, extent.width_px)
    height, width = (min(SIDE_PX, scale * side) // (2 * scale) * 2 * scale for side in most)
    return slanted_edge(height, width, along_columns=height >= width, levels=LEVELS)


def _photographed(bundle: Bundle, scene: NDArray[np.float32]) -> KnownCapture:
    part = find_part(bundle.manifest.kind, "bench", BenchPart)
    shot = Shot(
        set_name="edge",
        picture=Path("edge"),
        number=0,
        position=0,
        iso=part.isos[0],
        psf="bundle",
    )
    return known_capture(shot, part.photograph(shot, scene, bundle, bundle.frozen_optics))


def _of_capture(known_capture: KnownCapture, manifest: Manifest, scale: int) -> dict[str, float]:
    """Measure the samples themselves: the green ones of a mosaic, the middle one of planes."""
    samples = np.asarray(known_capture.capture, np.float64)
    plane = samples if samples.ndim == 2 else samples[len(samples) // 2]
    cfa = getattr(manifest.sensor, "cfa", None)
    sites = None
    if cfa is not None:
        y, x = np.mgrid[: plane.shape[0], : plane.shape[1]]
        sites = np.array(cfa_channels(cfa))[y % 2, x % 2] == 1
    return _edge_columns(CAPTURE, plane, scale, sites)


def _edge_columns(
    prefix: str, plane: NDArray[Any], scale: int, sites: NDArray[np.bool_] | None = None
) -> dict[str, float]:
    """Measure a plane whose pixels are `scale` of the picture's wide."""
    cut = min(CUT_PX // scale, min(plane.shape) // 8) // 2 * 2
    inside = np.s_[cut : plane.shape[0] - cut, cut : plane.shape[1] - cut]
    mtf = edge_mtf(
        plane[inside],
        cycles_per_px=scale * np.array(CYCLES_PER_PX),
        sites=None if sites is None else sites[inside],
        bins_per_px=BINS_PER_PX * min(scale, 2),
        reach_px=REACH_PX // scale,
    ).mtf
    return {f"{prefix}{name}": float(value) for name, value in zip(COLUMNS, mtf, strict=True)}
