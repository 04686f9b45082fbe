"""Depth and what goes with it, of histograms and gate scans."""

import time
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.runtime.cancel import check_cancelled
from camkit.runtime.kinds.spad.corrected import Strip
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.runtime.kinds.spad.finer.depth import FineSharpener
from camkit.runtime.kinds.spad.hot_pixels import check_map
from camkit.runtime.kinds.spad.products.archive import write_archive
from camkit.runtime.kinds.spad.products.picture import write_exr, write_tiff
from camkit.runtime.kinds.spad.products.points import write_points
from camkit.runtime.kinds.spad.products.preview import depth_picture, write_preview
from camkit.runtime.kinds.spad.products.record import told_pulse, told_way
from camkit.runtime.kinds.spad.products.strips import check_room, pieces
from camkit.runtime.kinds.spad.products.survey import Survey
from camkit.runtime.kinds.spad.pulse import Pulse
from camkit.runtime.kinds.spad.scatter import growth
from camkit.runtime.kinds.spad.sharpen import Sharpened, Sharpener, stacked
from camkit.runtime.kinds.spad.timing import LIGHT_M_PER_PS
from camkit.runtime.maker import Made, Making

LITTLE_LOST: Final = 0.02
"""Of the cycles: a pixel that lost less to pile-up scatters as Poisson counts do, within 1 %."""
PIXEL_BYTES: Final = 150
"""Of all arrays of one return."""
FINE_BYTES_OF_COUNT: Final = 290
"""What a count of the array takes behind a bundle, with all that is made of it."""
NAMED_HOT: Final = 10


def make_depth(making: Making, survey: Survey, began: float) -> Made:
    """Fit every pixel and say what was found.

    Args:
        making: The capture.
        survey: It, opened.
        began: When work on it began, of `time.perf_counter`.

    Raises:
        DecodeError: If the file is damaged, or holds no counts.
        ContractError: If what is stated of it cannot be true of it.
        Cancelled: If the caller wished so.
    """
    pulse, guessed = survey.pulse()
    read_s = time.perf_counter() - began
    if survey.camera is None:
        sharpener = Sharpener(survey.an_axis, pulse, survey.settings.way)
        found, blind, worst = _worked_through(making, survey, sharpener)
        told: Mapping[str, Any] = {}
    else:
        fine = fine_sharpener(survey, survey.camera, pulse)
        sharpener = fine.sharpener
        found, blind, worst, told = _made_finer(making, survey, fine)
    arrays = _arrays(found, survey)
    fit_s = time.perf_counter() - began - read_s
    array, scale = survey.timing.array, 1 if survey.camera is None else survey.camera.scale
    phase = 0 if survey.camera is None else survey.camera.sensor.phase
    is_known = array.pitch_um is not None and array.focal_length_mm is not None
    # where nothing is known of the lens, one whose focal length is the width of the array
    lens = {
        "pitch_um": (array.pitch_um or 1.0) / scale if is_known else 1.0 / scale,
        "focal_length_mm": (array.focal_length_mm or 1.0) if is_known else survey.shape[1] * 1e-3,
    }
    hot = _hot_places(found, scale)
    layers = arrays["depth_m"].reshape(found.valid.shape)
    intensity = arrays["intensity"].reshape(found.valid.shape)
    return Made(
        arrays=arrays,
        writers={
            ".npz": lambda path: write_archive(path, arrays),
            ".ply": lambda path: write_points(
                path, layers, intensity, **lens, scale=scale, phase=phase
            ),
            ".png": lambda path: write_preview(path, depth_picture(layers[0])),
        },
        pictures={
            "exr": (".exr", lambda path: write_exr(path, layers, "Z")),
            "tiff": (".tif", lambda path: write_tiff(path, layers)),
        },
        record={
            "product": "depth",
            **told_way(survey.settings.way),
            **told,
            **told_pulse(pulse, is_guessed=guessed is not None),
            "templates": len(sharpener.fitter.bank.mu_ps),
        },
        seconds={"read": read_s, "sharpen": fit_s},
        warnings=_warnings(found, blind, survey, guessed, hot, is_lens_known=is_known),
        sections={"spad": _section(found, blind, worst, hot)},
    )


def _worked_through(
    making: Making, survey: Survey, sharpener: Sharpener
) -> tuple[Sharpened, NDArray[np.bool_], float]:
    """Return what was found, which pixels were blind, and the worst loss to pile-up."""
    way = survey.settings.way
    cut = pieces(
        survey.shape,
        survey.bins,
        reach=way.reach_px,
        max_mem_bytes=survey.settings.max_mem_bytes,
        held_bytes=PIXEL_BYTES * way.returns * survey.shape[0] * survey.shape[1],
    )
    hot = survey.timing.hot(survey.shape)
    check_map(hot)
    found, blind, worst = [], [], 0.0
    for piece in cut:
        check_cancelled(making.cancel)
        strip = survey.rows.rows(piece.first, piece.end)
        rows = slice(piece.first, piece.end)
        found.append(
            sharpener.strip(
                strip.counts,
                hot=hot[rows],
                blind=strip.blind,
                core=piece.core,
                growth=_growth(survey, sharpener, strip),
            )
        )
        blind.append(strip.blind[piece.core])
        worst = max(worst, strip.worst)
        if making.progress is not None:
            making.progress(piece.bottom, survey.shape[0])
    return stacked(found), np.concatenate(blind), worst


def _made_finer(
    making: Making, survey: Survey, fine: FineSharpener
) -> tuple[Sharpened, NDArray[np.bool_], float, Mapping[str, Any]]:
    """Return the same on the fine grid of a bundle, and how it was found."""
    check_cancelled(making.cancel)
    check_room(survey.shape, survey.bins, FINE_BYTES_OF_COUNT, survey.settings.max_mem_bytes)
    strip = survey.rows.rows(0, survey.shape[0])
    made = fine.cube(
        strip.counts,
        survey.timing.dark(survey.shape),
        hot=survey.timing.hot(survey.shape),
        blind=strip.blind,
        growth=_growth(survey, fine.sharpener, strip),
    )
    if making.progress is not None:
        making.progress(survey.shape[0], survey.shape[0])
    told = {
        "finer": "linear" if made.size is None else "net",
        "size": made.size,
        "signal_photons": round(made.photons, 2),
    }
    return made.found, strip.blind, strip.worst, told


def _growth(survey: Survey, sharpener: Sharpener, strip: Strip) -> NDArray[np.float64] | None:
    """Return how much more the counts of pixels scatter for pile-up; None where it is little."""
    if strip.worst < LITTLE_LOST:
        return None
    flat = strip.counts.reshape(-1, strip.counts.shape[2])
    grown = growth(sharpener.fitter, flat, survey.timing.timing.cycles)
    return grown.reshape(strip.counts.shape[:2])


def fine_sharpener(survey: Survey, camera: FineCamera, pulse: Pulse) -> FineSharpener:
    """Return what sharpens a capture behind the plate of its bundle."""
    return FineSharpener(
        camera,
        survey.an_axis,
        pulse,
        survey.settings.way,
        size=survey.size_of_pictures,
        always=survey.settings.finer == "net",
    )


def _arrays(found: Sharpened, survey: Survey) -> dict[str, NDArray[Any]]:
    """Return the arrays of the archive; the leading axis goes where there is one return."""
    scale = 1 if survey.camera is None else survey.camera.scale
    dark = survey.timing.dark(survey.shape).repeat(scale, axis=0).repeat(scale, axis=1)
    depth = (found.time_of_flight_ps - survey.timing.correction.offset_ps) * LIGHT_M_PER_PS / 2
    arrays: dict[str, NDArray[Any]] = {
        "depth_m": np.where(found.valid, depth, np.nan),
        "time_of_flight_ps": found.time_of_flight_ps,
        "amplitude": found.amplitude.astype(np.float32),
        "background": np.maximum(found.background - dark, 0.0).astype(np.float32),
        "sigma_ps": found.sigma_ps.astype(np.float32),
        "evidence": found.evidence.astype(np.float32),
        "intensity": (found.intensity - dark * survey.bins).astype(np.float32),
        "valid": found.valid,
        "pooled": found.pooled.astype(np.uint8),
    }
    if survey.settings.way.returns == 1:
        return {name: values[0] for name, values in arrays.items()}
    return arrays


def _hot_places(found: Sharpened, scale: int) -> list[list[int]]:
    """Return the hot pixels of the array, (x, y)."""
    return [[int(x), int(y)] for y, x in np.argwhere(found.hot[0][::scale, ::scale])]


def _section(
    found: Sharpened, blind: NDArray[np.bool_], worst: float, hot: list[list[int]]
) -> Mapping[str, Any]:
    sides, counts = np.unique(found.pooled[found.valid], return_counts=True)
    return {
        "pixels": int(found.hot[0].size),
        "valid": [int(layer.sum()) for layer in found.valid],
        "hot": hot,
        "blind": int(blind.sum()),
        "pile_up": round(worst, 4),
        "pooled": {str(s): int(n) for s, n in zip(sides.tolist(), counts.tolist(), strict=True)},
        "photons": float(np.round(found.intensity[0].sum(), 1)),
    }


def _warnings(
    found: Sharpened,
    blind: NDArray[np.bool_],
    survey: Survey,
    guessed: str | None,
    hot: list[list[int]],
    *,
    is_lens_known: bool,
) -> tuple[str, ...]:
    told = [] if guessed is None else [guessed]
    if hot:
        places = ", ".join(f"({x}, {y})" for x, y in hot[:NAMED_HOT])
        more = f" and {len(hot) - NAMED_HOT} more" if len(hot) > NAMED_HOT else ""
        told.append(f"hot pixels at {places}{more}: filled from their neighbours, marked not valid")
    if blind.any():
        told.append(
            f"pile-up is too strong to correct in {int(blind.sum())} pixels: they are marked not "
            "valid"
        )
    if not found.valid.any():
        told.append("no pixel has enough photons for a reliable distance")
    if not is_lens_known:
        told.append(
            "the lens is not stated: the point cloud assumes a focal length equal to the width of "
            "the array; state [array] pitch_um and focal_length_mm"
        )
    return (*told, *survey.warnings())
