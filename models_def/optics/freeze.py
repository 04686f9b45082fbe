"""Freezing a prescription: as few PSF samples and as large blocks as the stated loss allows.

candidates -> frozen_loss (dB of the Wiener filter alone) -> FrozenPsf -> psf.safetensors,
FrozenPsf -> block_loss of block grids -> FreezeReport
"""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Final

from camkit.bundle.camera import Camera
from camkit.bundle.stages import Wiener
from camkit.contracts import FrozenPsf
from camkit.errors import ContractError
from camkit.models_def.optics.frozen import (
    FreezeGrid,
    Frozen,
    freeze,
    freeze_at,
    freeze_stress,
)
from camkit.models_def.optics.lens_file.lens_file import read_lens
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.sampling import Bench, Loss, block_loss, frozen_loss, make_bench
from camkit.models_def.sensors.wiener import PRIOR_EXPONENT, PRIOR_SCALE

__all__ = [
    "FreezeGrid",
    "FreezeReport",
    "Frozen",
    "choose_blocks",
    "choose_samples",
    "freeze",
    "freeze_at",
    "freeze_prescription",
    "freeze_stress",
]

LOSS_LIMIT_DB: Final = 0.05
BLOCK_TOLERANCE_DB: Final = 0.1
FIELD_COUNTS: Final = (7, 9, 11, 13, 17, 21, 25)
WAVELENGTH_COUNTS: Final = (3, 5, 7, 9, 11, 13)
BLOCKS: Final = ((768, 160), (512, 160), (384, 160), (512, 192), (384, 192))


@dataclass(frozen=True, slots=True, kw_only=True)
class FreezeReport:
    """What freezing kept and what it cost; every value goes into the manifest.

    Attributes:
        fields: Field heights kept.
        wavelengths: Wavelengths kept.
        side_px: Kernel side.
        energy_kept: Least share of a colour's light inside a kernel.
        loss_db: Mean loss against the PSF traced at the place of use.
        worst_loss_db: The same at the worst place, copy and ISO.
        loss_limit_db: What was allowed for the mean.
        block_px: Chosen block of the Wiener bank.
        overlap_px: Its overlap.
        block_loss_db: Mean loss of one kernel per block.
        efl_mm: Of the lens.
        corner_illumination: Relative illumination at the corner.
    """

    fields: int
    wavelengths: int
    side_px: int
    energy_kept: float
    loss_db: float
    worst_loss_db: float
    loss_limit_db: float
    block_px: int
    overlap_px: int
    block_loss_db: float
    efl_mm: float
    corner_illumination: float

    def to_json(self) -> dict[str, int | float | str]:
        """Give the report as a flat mapping."""
        return {k: round(v, 5) if isinstance(v, float) else v for k, v in asdict(self).items()}


def choose_samples(
    lens: Lens,
    camera: Camera,
    bench: Bench,
    *,
    limit_db: float = LOSS_LIMIT_DB,
    grid: FreezeGrid | None = None,
) -> tuple[Frozen, Loss]:
    """Freeze with the least wavelengths, then the least fields, whose mean loss is allowed.

    Wavelengths are chosen with the most fields and half of the allowance.

    Raises:
        ContractError: If even the densest grid loses more.
    """
    base = grid or FreezeGrid()
    fields = FIELD_COUNTS[-1]
    waves = WAVELENGTH_COUNTS[-1]
    for count in WAVELENGTH_COUNTS:
        frozen = freeze(lens, camera, replace(base, fields=fields, wavelengths=count))
        if frozen_loss(frozen.psf, bench).mean_db <= limit_db / 2:
            waves = count
            break
    loss = Loss(mean_db=0.0, worst_db=0.0)
    for count in FIELD_COUNTS:
        frozen = freeze(lens, camera, replace(base, fields=count, wavelengths=waves))
        loss = frozen_loss(frozen.psf, bench)
        if loss.mean_db <= limit_db:
            return frozen, loss
    raise ContractError(
        f"{fields} fields and {waves} wavelengths lose {loss.mean_db:.3f} dB, more than the "
        f"allowed {limit_db}; allow more or use a smoother lens"
    )


def choose_blocks(
    psf: FrozenPsf, bench: Bench, *, limit_db: float = LOSS_LIMIT_DB
) -> tuple[Wiener, Loss]:
    """Give the cheapest block grid that loses little.

    Little is the allowed loss, or, where no grid keeps it, `BLOCK_TOLERANCE_DB` more than the
    best grid loses. The cost of a grid is the area filtered per area answered for.
    """
    tried: list[tuple[Wiener, Loss]] = []
    for block_px, overlap_px in sorted(BLOCKS, key=lambda b: (b[0] / (b[0] - b[1])) ** 2):
        settings = bench.settings.model_copy(
            update={"block_px": block_px, "overlap_px": overlap_px}
        )
        loss = block_loss(psf, bench, settings)
        tried.append((settings, loss))
        if loss.mean_db <= limit_db:
            break
    best_db = min(loss.mean_db for _, loss in tried)
    allowed_db = max(limit_db, best_db + BLOCK_TOLERANCE_DB)
    return next(pair for pair in tried if pair[1].mean_db <= allowed_db)


def freeze_prescription(
    path: Path,
    out_path: Path,
    *,
    camera: Camera,
    settings: Wiener | None = None,
    limit_db: float = LOSS_LIMIT_DB,
    grid: FreezeGrid | None = None,
) -> FreezeReport:
    """Freeze the PSF of a prescription and write it.

    Args:
        path: The lens (TOML).
        out_path: Receives the frozen PSF (safetensors).
        camera: Sensor size, pitch, response and noise.
        settings: Of the Wiener filter that measures the loss.
        limit_db: Mean loss allowed for the samples, and for the blocks.
        grid: Rays, energy and depths; its fields and wavelengths are chosen here.

    Raises:
        ContractError: If the prescription is wrong or no grid keeps the loss.
    """
    from camkit.bundle.psf_file import write_psf

    lens = read_lens(path)
    chosen = settings or Wiener(prior_scale=PRIOR_SCALE, prior_exponent=PRIOR_EXPONENT)
    rays = (grid or FreezeGrid()).rays
    bench = make_bench(lens, camera, chosen, rays=rays)
    frozen, loss = choose_samples(lens, camera, bench, limit_db=limit_db, grid=grid)
    blocks, blocked = choose_blocks(frozen.psf, bench, limit_db=limit_db)
    write_psf(out_path, frozen.psf)
    fields, _, wavelengths, side_px, _ = frozen.psf.kernels.shape
    return FreezeReport(
        fields=fields,
        wavelengths=wavelengths,
        side_px=side_px,
        energy_kept=frozen.energy_kept,
        loss_db=loss.mean_db,
        worst_loss_db=loss.worst_db,
        loss_limit_db=limit_db,
        block_px=blocks.block_px,
        overlap_px=blocks.overlap_px,
        block_loss_db=blocked.mean_db,
        efl_mm=paraxial_data(lens).efl_mm,
        corner_illumination=float(frozen.psf.relative_illumination[-1]),
    )
