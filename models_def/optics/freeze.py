"""Optics frozen by samples: as few of the PSF and as large blocks as the stated loss allows.

candidates -> frozen_loss (dB of the Wiener filter alone) -> FrozenPsf,
FrozenPsf -> block_loss of block grids -> block_px, overlap_px

With `freeze_quickly` nothing is searched: a fixed grid, and blocks by the width of the kernels.

Of several depths the nearest and the farthest are kept, and of those between them as few as the
loss allows, with the depth known to the filter (interpolated kernels) and unknown to it (the mean
kernel).
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.sensor import ColorSensor
from camkit.bundle.stages import Wiener
from camkit.errors import ContractError
from camkit.models_def.optics.freezable_optics import Optics
from camkit.models_def.optics.frozen import (
    FreezeGrid,
    Frozen,
    corner_height_mm,
    freeze,
    with_focus,
)
from camkit.models_def.optics.lens_optics import LensOptics
from camkit.models_def.optics.sampling_loss import (
    Bench,
    Loss,
    block_loss,
    frozen_loss,
    make_bench,
    make_probes,
    mean_kernel_loss,
)
from camkit.models_def.sensors.wiener import PRIOR_EXPONENT, PRIOR_SCALE
from camkit.psf import FrozenPsf

Tell = Callable[[str], None]
Facts = dict[str, int | float | str]
"""Report of freezing, flat: units in the names."""

LOSS_LIMIT_DB: Final = 0.05
QUICK: Final = FreezeGrid(fields=7, wavelengths=5)
QUICK_BLOCKS: Final = ((240, 80), (256, 96), (320, 112), (384, 160), (512, 192))
DEPTH_SHARE: Final = 0.75
BLOCK_TOLERANCE_DB: Final = 0.05
FIELD_COUNTS: Final = (7, 9, 11, 13, 17, 21, 25)
WAVELENGTH_COUNTS: Final = (3, 5, 7, 9, 11, 13)
BLOCKS: Final = (
    (768, 160),
    (512, 160),
    (384, 160),
    (512, 192),
    (384, 192),
    (320, 112),
    (256, 96),
    (240, 80),
    (216, 96),
)
BLOCK_REACH: Final = 0.6
"""Overlap of blocks over the side of a kernel, at least: with less, light that one block knows of
and its neighbour does not leaves a step between them, however small the mean loss."""


def _silent(_: str) -> None:
    pass


def choose_grid(
    optics: Optics,
    sensor: ColorSensor,
    bench: Bench,
    *,
    limit_db: float = LOSS_LIMIT_DB,
    grid: FreezeGrid | None = None,
    tell: Tell = _silent,
) -> tuple[Frozen, Loss]:
    """Freeze with the least wavelengths, then depths, then fields, whose mean loss is allowed.

    Wavelengths are chosen with the most fields and half of the allowance, depths with three
    quarters of it. There is nothing to choose where optics are known at samples of their own.

    Args:
        optics: Nominal.
        sensor: Response, size and noise.
        bench: The optics where they are judged, at the depths that may be kept.
        limit_db: Mean loss allowed.
        grid: Energy and largest side; the rest is chosen here.
        tell: Takes a line for everything that was tried.

    Raises:
        ContractError: If even the densest grid loses more.
    """
    base = replace(grid or FreezeGrid(), depths_mm=bench.depths_mm)
    fields = FIELD_COUNTS[-1]
    waves = WAVELENGTH_COUNTS[-1]
    for count in WAVELENGTH_COUNTS:
        frozen = freeze(optics, sensor, replace(base, fields=fields, wavelengths=count))
        lost_db = frozen_loss(frozen.psf, bench).mean_db
        tell(f"{_samples(frozen)}: {lost_db:.3f} dB")
        if lost_db <= limit_db / 2 or optics.wavelengths_um is not None:
            waves = count
            break
    kept_mm = choose_depths(frozen.psf, bench, limit_db=DEPTH_SHARE * limit_db)
    base = replace(base, depths_mm=kept_mm)
    loss = Loss(mean_db=0.0, worst_db=0.0)
    for count in _field_counts(optics, sensor):
        frozen = freeze(optics, sensor, replace(base, fields=count, wavelengths=waves))
        loss = frozen_loss(frozen.psf, bench)
        tell(f"{_samples(frozen)}: {loss.mean_db:.3f} dB")
        if loss.mean_db <= limit_db:
            return frozen, loss
    raise ContractError(
        f"{_samples(frozen)} lose {loss.mean_db:.3f} dB, more than the allowed {limit_db}; allow "
        "more or use smoother optics"
    )


def _field_counts(optics: Optics, sensor: ColorSensor) -> tuple[int, ...]:
    """Return the numbers of fields to try: one where they make no difference."""
    corner_mm = corner_height_mm(sensor)
    few, many = (optics.layout(corner_mm, FIELD_COUNTS[i]).count for i in (0, -1))
    return FIELD_COUNTS if few != many or len(FIELD_COUNTS) == 1 else FIELD_COUNTS[-1:]


def _samples(frozen: Frozen) -> str:
    fields, _, wavelengths = frozen.psf.kernels.shape[:3]
    return f"{wavelengths} wavelengths, {fields} fields"


def choose_depths(psf: FrozenPsf, bench: Bench, *, limit_db: float) -> tuple[float, ...]:
    """Return the nearest and the farthest depth, and as few between them as the loss allows.

    Args:
        psf: With all depths of the bench.
        bench: The optics at their depths.
        limit_db: Mean loss allowed, both of interpolated kernels and of the mean kernel.
    """
    count = len(bench.depths_mm)
    indices = sorted({0, count - 1})
    while len(indices) < count:
        thin = replace(psf, kernels=psf.kernels[:, indices], depths_mm=psf.depths_mm[indices])
        losses = frozen_loss(thin, bench), mean_kernel_loss(thin, psf, bench)
        worst = max(losses, key=lambda loss: loss.mean_db)
        if worst.mean_db <= limit_db:
            break
        others = (i for i in range(count) if i not in indices)
        indices = sorted([*indices, max(others, key=worst.by_depth_db.__getitem__)])
    return tuple(bench.depths_mm[i] for i in indices)


def between_mm(depths_mm: tuple[float, ...]) -> tuple[float, ...]:
    """Return the distances half-way in 1 / distance between neighbours."""
    return tuple(2 / (1 / near + 1 / far) for near, far in pairwise(depths_mm))


def choose_blocks(psf: FrozenPsf, bench: Bench, *, tell: Tell = _silent) -> tuple[Wiener, Loss]:
    """Return the cheapest block grid that loses `BLOCK_TOLERANCE_DB` more than the best at most.

    Tried are those of `BLOCKS` whose overlap suits the kernels (`BLOCK_REACH`; the widest where
    none does) and the grid of the bench's own settings. The cost of a grid is the area filtered
    per area answered for. A small block may gain, since its prior is that of its place.
    """
    reach_px = min(BLOCK_REACH * psf.kernels.shape[-1], max(overlap for _, overlap in BLOCKS))
    suited = {grid for grid in BLOCKS if grid[1] >= reach_px}
    grids = {*suited, (bench.settings.block_px, bench.settings.overlap_px)}
    cheapest_first = [
        bench.settings.model_copy(update={"block_px": block_px, "overlap_px": overlap_px})
        for block_px, overlap_px in sorted(grids, key=lambda b: ((b[0] / (b[0] - b[1])) ** 2, b))
    ]
    probes = make_probes(psf, bench, cheapest_first)
    trials: list[tuple[Wiener, Loss]] = []
    for settings in cheapest_first:
        loss = block_loss(psf, bench, settings, probes)
        grid = f"blocks of {settings.block_px} px, overlap {settings.overlap_px}"
        tell(f"{grid}: {loss.mean_db:.3f} dB")
        trials.append((settings, loss))
    allowed_db = min(loss.mean_db for _, loss in trials) + BLOCK_TOLERANCE_DB
    return next(pair for pair in trials if pair[1].mean_db <= allowed_db)


def freeze_samples(
    optics: Optics,
    *,
    sensor: ColorSensor,
    settings: Wiener | None = None,
    limit_db: float = LOSS_LIMIT_DB,
    grid: FreezeGrid | None = None,
    focus_um: float = 0.0,
    tell: Tell = _silent,
) -> tuple[FrozenOptics, Facts]:
    """Freeze the PSF of optics.

    Args:
        optics: A lens, or a PSF that was measured; see `read_optics`.
        sensor: Size, pitch, response and noise.
        settings: Of the Wiener filter that measures the loss.
        limit_db: Mean loss allowed for the samples.
        grid: Energy, largest side and depths; fields, wavelengths and which of the depths are kept
            are chosen here.
        focus_um: How far the sensor of a lens is moved to both sides for kernels of units whose
            focus is measured; 0 for none. The nominal kernels do not depend on it.
        tell: Takes a line for everything that was tried.

    Returns:
        The kernels, and what they keep and cost: `energy_kept` is the least share of a colour's
        light inside a kernel; `loss_db` the mean loss against the PSF traced at the place of use,
        `worst_loss_db` that of the worst place, copy and ISO; `block_loss_db` that of one kernel
        per block. Of several depths `between_loss_db` is the mean loss of interpolated kernels
        half-way (in 1 / distance) between those kept: it is not limited, and says what a depth
        given to `process` may cost.

    Raises:
        ContractError: If the optics are wrong or no grid keeps the loss.
    """
    filter_settings = settings or Wiener(prior_scale=PRIOR_SCALE, prior_exponent=PRIOR_EXPONENT)
    # losses of samples by the same filter for every camera, each colour alone
    alone = filter_settings.alone()
    freeze_grid = grid or FreezeGrid()
    tell(f"tracing {optics.name} and its copies")
    bench = make_bench(optics, sensor, alone, grid=freeze_grid)
    frozen, loss = choose_grid(optics, sensor, bench, limit_db=limit_db, grid=grid, tell=tell)
    own_bench = replace(bench, settings=filter_settings)
    blocks, blocked = choose_blocks(frozen.psf, own_bench, tell=tell)
    psf, focus_kept = frozen.psf, 0.0
    if focus_um and isinstance(optics, LensOptics):
        tell(f"tracing {optics.name} with its sensor moved by {focus_um:g} um to both sides")
        psf, focus_kept = with_focus(psf, (-focus_um, focus_um), optics.refocused, sensor)
    middles_mm = between_mm(tuple(frozen.psf.depths_mm.tolist()))
    between_db = None
    if middles_mm:
        there = make_bench(optics, sensor, alone, grid=replace(freeze_grid, depths_mm=middles_mm))
        between_db = frozen_loss(frozen.psf, there).mean_db
    facts = _facts(frozen, loss, limit_db) | {
        "block_px": blocks.block_px,
        "overlap_px": blocks.overlap_px,
        "block_loss_db": blocked.mean_db,
        **optics.facts,
        "corner_illumination": _corner_light(frozen.psf),
    }
    if between_db is not None:
        facts["between_loss_db"] = between_db
    if focus_um:
        facts |= {"focus_um": focus_um, "focus_energy_kept": focus_kept}
    if between_db is not None:
        facts["depths_mm"] = depths_text(frozen.psf)
    return FrozenOptics(psf=psf), rounded_facts(facts)


def freeze_quickly(
    optics: Optics, *, sensor: ColorSensor, grid: FreezeGrid | None = None, tell: Tell = _silent
) -> tuple[FrozenOptics, Facts]:
    """Freeze the PSF of optics at the fields and wavelengths of `QUICK`, without a search.

    What the samples and the blocks cost is not measured: a tenth of the time of `freeze_samples`.

    Args:
        optics: A lens, or a PSF that was measured.
        sensor: Size, pitch, response and noise.
        grid: Energy, largest side and depths.
        tell: Takes a line.

    Raises:
        ContractError: If the optics are wrong, or the largest side does not hold the wanted light.
    """
    base = grid or FreezeGrid()
    tell(f"tracing {optics.name}")
    frozen = freeze(
        optics, sensor, replace(base, fields=QUICK.fields, wavelengths=QUICK.wavelengths)
    )
    block_px, overlap_px = usual_blocks(frozen.psf.kernels.shape[-1])
    facts: Facts = {
        **_sample_facts(frozen),
        "block_px": block_px,
        "overlap_px": overlap_px,
        **optics.facts,
        "corner_illumination": _corner_light(frozen.psf),
        "quick": "no search",
    }
    if len(frozen.psf.depths_mm) > 1:
        facts["depths_mm"] = depths_text(frozen.psf)
    return FrozenOptics(psf=frozen.psf), rounded_facts(facts)


def usual_blocks(side_px: int) -> tuple[int, int]:
    """Return the first blocks of `QUICK_BLOCKS` whose overlap suits kernels, the last else."""
    suited = (grid for grid in QUICK_BLOCKS if grid[1] >= BLOCK_REACH * side_px)
    return next(suited, QUICK_BLOCKS[-1])


def _facts(frozen: Frozen, loss: Loss, limit_db: float) -> Facts:
    return {
        **_sample_facts(frozen),
        "loss_db": loss.mean_db,
        "worst_loss_db": loss.worst_db,
        "loss_limit_db": limit_db,
    }


def _sample_facts(frozen: Frozen) -> Facts:
    fields, _, wavelengths, side_px, _ = frozen.psf.kernels.shape
    return {
        "fields": fields,
        "wavelengths": wavelengths,
        "side_px": side_px,
        "energy_kept": frozen.energy_kept,
    }


def _corner_light(psf: FrozenPsf) -> float:
    """Return the relative illumination at the place farthest from the axis."""
    return float(psf.relative_illumination[int(np.argmax(psf.field_heights_mm))])


def depths_text(psf: FrozenPsf) -> str:
    """Return the depths of a PSF for its report."""
    return ", ".join(f"{depth_mm:g}" for depth_mm in psf.depths_mm)


def rounded_facts(facts: Facts) -> Facts:
    """Return facts with numbers of five decimals."""
    return {k: round(v, 5) if isinstance(v, float) else v for k, v in facts.items()}
