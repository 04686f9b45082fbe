"""The measurement as a whole: photographs that belong together, their edges, kernels, facts."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from camkit.calibration.blur.blur_facts import (
    PhotoBlur,
    blur_uncertainty,
    coverage_notes,
    frozen_blur,
    height_facts,
)
from camkit.calibration.blur.held_out_edges import judge_held_out
from camkit.calibration.blur.photo_blur import (
    LEAST_EDGES,
    edge_groups,
    first_spreads,
    fit_blur,
    node_heights,
)
from camkit.calibration.blur.photo_edges import (
    EdgeSearch,
    FieldAxes,
    PhotoEdge,
    find_photo_edges,
)
from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError
from camkit.progress import working
from camkit.runtime.capture import Capture

REACHES_PX: Final = (28.0, 16.0, 8.0)
"""To both sides of an edge, that are tried where none is stated."""
LEAST_REACH_PX: Final = 6.0
MOST_REACH_PX: Final = 64.0
SPREADS: Final = 6.0
"""Standard deviations of the blur to which edges are looked at."""
TRIED_PHOTOS: Final = 3
TRIED_PLACES: Final = 400
ENOUGH_EDGES: Final = 12
"""In the photographs that are tried, to choose the reach by."""
MOST_PLACES: Final = 1600
"""That are looked at in a photograph."""
MOST_EDGES: Final = 900
"""In all photographs, beyond which some are left out."""
_QUANTILE: Final = 0.3
Read = Callable[[], Capture]


@dataclass(frozen=True, slots=True, kw_only=True)
class BlurOptions:
    """The caller's options.

    Attributes:
        pixel_pitch_um: None for what the photographs state.
        reach_px: To both sides of an edge, how far nothing else may be; None chooses it.
        depth_m: Distance of the scenes.
    """

    pixel_pitch_um: float | None = None
    reach_px: float | None = None
    depth_m: float = np.inf

    def __post_init__(self) -> None:
        pitch, reach = self.pixel_pitch_um, self.reach_px
        if pitch is not None and not (np.isfinite(pitch) and pitch > 0):
            raise ContractError(f"{option_text('pixel_pitch_um')} must be > 0; got {pitch:g}")
        if reach is not None and not LEAST_REACH_PX <= reach <= MOST_REACH_PX:
            raise ContractError(
                f"{option_text('reach_px')} is {LEAST_REACH_PX:g} to {MOST_REACH_PX:g}; got "
                f"{reach:g}"
            )
        if not self.depth_m > 0:
            raise ContractError(f"{option_text('depth_m')} must be > 0; got {self.depth_m:g}")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Setting:
    """The facts that all photographs must have in common."""

    name: str
    facts: dict[str, Any]
    axes_size_px: tuple[int, int]
    pitch_um: float


@working("measuring the blur of a lens")
def measure_blur(photos: Sequence[tuple[str, Read]], options: BlurOptions) -> PhotoBlur:
    """Measure the blur of a lens over the field on edges in photographs.

    Args:
        photos: Name and reader of each photograph; linear, one lens at one setting.
        options: What the caller says of them.

    Raises:
        ContractError: If no pixel pitch is known.
        DecodeError: If they are of several cameras or settings, or show too few edges.
    """
    reach_px = options.reach_px or _chosen_reach(photos, options)
    edges: list[PhotoEdge] = []
    searches: dict[str, EdgeSearch] = {}
    first: _Setting | None = None
    for number, (name, read) in enumerate(photos):
        capture = read()
        setting = _setting(name, capture, options)
        first = first or setting
        _check_alike(first, setting)
        search = find_photo_edges(
            capture, _axes(capture, setting), photo=number, reach_px=reach_px, most=MOST_PLACES
        )
        searches[name] = search
        edges += search.edges
    assert first is not None
    _check_enough(edges, searches, reach_px)
    radius_mm = float(np.hypot(*first.axes_size_px)) / 2 * first.pitch_um / 1000
    edge_count = len(edges)
    edges = _spread(edges, radius_mm)
    group = edge_groups(edges, radius_mm)
    model = fit_blur(edges, group, radius_mm, reach_px)
    _, bare_heights = node_heights(edges, radius_mm)
    notes = coverage_notes(model, edges, radius_mm, bare_heights)
    if edge_count > len(edges):
        notes.append(f"of {edge_count} edges {len(edges)} were used, spread over the field")
    notes.append(
        "edges count as steps: a blur that even the sharpest edges of the scenes have, or a "
        "sharpening of developed pictures, is in the kernels"
    )
    notes.append(f"light beyond {reach_px:g} px from the middle of a kernel is not determined")
    return PhotoBlur(
        psf=frozen_blur(model, first.pitch_um, options.depth_m),
        uncertainty=blur_uncertainty(model),
        heights=height_facts(model, edges),
        held_out=judge_held_out(edges, group, model, reach_px),
        photos={name: (len(one.edges), one.places, one.clipped) for name, one in searches.items()},
        reach_px=reach_px,
        edges=edge_count,
        sharp=int(model.sharp_half.any(axis=1).sum()),
        smoothness=model.smoothness,
        notes=tuple(notes),
    )


def _setting(name: str, capture: Capture, options: BlurOptions) -> _Setting:
    size = capture.sensor_size_px or (capture.width, capture.height)
    pitch_um = options.pixel_pitch_um or capture.pixel_pitch_um
    if pitch_um is None:
        raise ContractError(f"{name} states no pixel pitch; add {option_text('pixel_pitch_um')}")
    metadata = capture.metadata
    return _Setting(
        name=name,
        facts={
            "size of the sensor": size,
            "number of colours": capture.channels,
            "mosaic": None if capture.cfa is None else "".join(sorted(capture.cfa)),
            "pixel pitch": round(pitch_um, 4),
            "camera": capture.camera or metadata.camera,
            "lens": metadata.lens_model,
            "f-number": metadata.f_number,
            "focal length": metadata.focal_length_mm,
        },
        axes_size_px=size,
        pitch_um=pitch_um,
    )


def _check_alike(one: _Setting, other: _Setting) -> None:
    for what, value in one.facts.items():
        if other.facts[what] != value:
            raise DecodeError(
                f"photographs differ in {what}: {one.name} has {value}, {other.name} "
                f"{other.facts[what]}; give those of one camera and lens at one setting"
            )


def _axes(capture: Capture, setting: _Setting) -> FieldAxes:
    width, height = setting.axes_size_px
    left, top = capture.origin_px or (0, 0)
    return FieldAxes(
        axis_px=((width - 1) / 2 - left, (height - 1) / 2 - top),
        pitch_um=setting.pitch_um,
        radius_mm=float(np.hypot(width, height)) / 2 * setting.pitch_um / 1000,
    )


def _chosen_reach(photos: Sequence[tuple[str, Read]], options: BlurOptions) -> float:
    """Return how far edges are to be looked at: as wide as the blur of some photographs asks."""
    step = max(1, len(photos) // TRIED_PHOTOS)
    samples = [(name, read()) for name, read in photos[::step][:TRIED_PHOTOS]]
    for reach_px in REACHES_PX:
        edges: list[PhotoEdge] = []
        for number, (name, capture) in enumerate(samples):
            axes = _axes(capture, _setting(name, capture, options))
            edges += find_photo_edges(
                capture, axes, photo=number, reach_px=reach_px, most=TRIED_PLACES
            ).edges
        if len(edges) >= ENOUGH_EDGES:
            spread = float(np.nanquantile(first_spreads(edges, reach_px), _QUANTILE))
            return float(np.clip(np.ceil(SPREADS * spread), LEAST_REACH_PX, reach_px))
    return REACHES_PX[-1]


def _check_enough(
    edges: Sequence[PhotoEdge], searches: dict[str, EdgeSearch], reach_px: float
) -> None:
    if len(edges) >= LEAST_EDGES:
        return
    clipped = sum(one.clipped for one in searches.values())
    why = f"; {clipped} places are clipped: expose less" if clipped else ""
    raise DecodeError(
        f"{len(searches)} photographs show {len(edges)} straight edges that stand alone for "
        f"{reach_px:g} px, {LEAST_EDGES} are needed{why}; give more photographs of things with "
        f"straight, sharp borders, or a smaller {option_text('reach_px')}"
    )


def _spread(edges: Sequence[PhotoEdge], radius_mm: float) -> list[PhotoEdge]:
    """Return the edges, or as many of every part of the field where they are too many."""
    if len(edges) <= MOST_EDGES:
        return list(edges)
    order = np.random.default_rng(0).permutation(len(edges))
    zone = np.array([min(int(edge.height_mm / radius_mm * 6), 5) for edge in edges])
    place = np.empty(len(edges))
    for n in range(6):
        mine = order[zone[order] == n]
        place[mine] = np.arange(mine.size)
    picked = np.sort(np.argsort(place, kind="stable")[:MOST_EDGES])
    return [edges[i] for i in picked]
