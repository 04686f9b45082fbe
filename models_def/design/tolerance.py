"""The cost of fabrication errors after recovery: PSNR of Monte-Carlo samples, yield, worst errors.

Captures are made with the kernels of fabricated lenses (Monte-Carlo samples, `copies`) and
recovered by the Wiener filter of the nominal lens, the only one that a bundle knows. Patches and
noise are the same for every sample. Patches repeat beyond their borders, as the Fourier transform
of the filter takes them to: no ringing from the border reaches the judged part, however wide the
kernels.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.design.front import Front
from camkit.models_def.design.ranking import Offender, Ranked, rank_errors
from camkit.models_def.design.sensor import Recorder, capture
from camkit.models_def.optics.aiming.field import widest_tangent
from camkit.models_def.optics.kernel_bank import gaussian_response
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import both_halves, half_disc
from camkit.models_def.optics.tolerance.air_gap import with_adjusted_gap, with_chosen_gap
from camkit.models_def.optics.tolerance.deviation import (
    Deviations,
    Single,
    draw_deviations,
    no_deviations,
    single_deviations,
)
from camkit.models_def.optics.tolerance.errors import ErrorClass, Tolerances
from camkit.models_def.optics.tolerance.fabricated import Landing, View, land
from camkit.models_def.optics.tolerance.landing import copy_kernels, spot_rms_mm, window_px
from camkit.models_def.sensors.tone import encode_srgb
from camkit.models_def.training.pictures import open_source
from camkit.units import to_radians

# share of the largest field, azimuth: the axis, a ring of diagonals, the edge in four directions
FIELDS: Final = (
    (0.0, 0.0),
    *((0.7, float(azimuth)) for azimuth in (45, 135, 225, 315)),
    *((1.0, float(azimuth)) for azimuth in (0, 90, 180, 270)),
)
_LARGEST_KERNEL_PX: Final = 127
_LOST_SHARE: Final = 0.005
_PROBES: Final = 4
_BATCH: Final = 4
_SCENES: Final = 4
_SCENE_PX: Final = 512
_VISIBLE_UM: Final = (0.36, 0.83)

Array = NDArray[np.float64]
Watch = Callable[[int, int], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class ToleranceRun:
    """The settings of a run: the draw of copies, and their judgement.

    Attributes:
        copies: Fabricated copies.
        limit_copies: Copies per class with that class alone at its half-width.
        seed: Of errors, patches and noise.
        pitch_um: Of the pixels.
        noise: Standard deviation, 1.0 = white level.
        patch_px: Side of a patch.
        patches: Per field.
        rays: Of the pupil.
        pictures: Folder of sharp pictures; None for procedural scenes.
        ranking: Judge every single error at both limits too, which takes most of the time.
    """

    copies: int = 50
    limit_copies: int = 4
    seed: int = 1
    pitch_um: float = 6.0
    noise: float = 0.01
    patch_px: int = 96
    patches: int = 2
    rays: int = 512
    pictures: Path | None = None
    ranking: bool = True

    def __post_init__(self) -> None:
        counts = (self.copies, self.limit_copies, self.patch_px, self.patches, self.rays // 2)
        if min(counts) < 1 or self.seed < 0:
            raise ContractError(
                f"counts of a tolerance run must be >= 1, the seed >= 0; got {self}"
            )
        if not self.pitch_um > 0:
            raise ContractError(f"pitch_um must be > 0; got {self.pitch_um}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """The results of copies.

    Attributes:
        psnr_db: (copy, field), of sRGB values after recovery, the mean over patches.
        spot_rms_mm: (copy, field), all wavelengths alike, about the centroid.
        refocus_mm: (copy,), by how much the compensator moved the sensor away.
        gap_mm: (copy,), by how much it made the air gap larger.
        energy_kept: Least share of light inside the kernel window.
    """

    psnr_db: Array
    spot_rms_mm: Array
    refocus_mm: Array
    gap_mm: Array
    energy_kept: float

    @property
    def mean_db(self) -> Array:
        """Mean over the fields, (copy,)."""
        return np.asarray(self.psnr_db.mean(1))


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassLoss:
    """The cost of one class of errors, alone and at its half-width.

    Attributes:
        error_class: The class.
        half_width: In its unit.
        loss_db: (copy,), mean over fields.
        spot_growth_mm: Of the RMS radius over all fields, the mean over copies.
    """

    error_class: ErrorClass
    half_width: float
    loss_db: Array
    spot_growth_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ToleranceResult:
    """All results of a run.

    Attributes:
        lens: Nominal.
        tolerances: What was drawn; a gap that assembly adjusts is named.
        run: How.
        fields: (share of the largest slope, azimuth in degrees).
        kernel_px: Window of the kernels.
        nominal: The lens as designed.
        copies: Fabricated copies.
        classes: The largest loss first.
        offenders: Single errors, the largest growth of spots first; none without a ranking.
    """

    lens: Lens
    tolerances: Tolerances
    run: ToleranceRun
    fields: tuple[tuple[float, float], ...]
    kernel_px: int
    nominal: Measured
    copies: Measured
    classes: tuple[ClassLoss, ...]
    offenders: tuple[Offender, ...]

    @property
    def ranking(self) -> tuple[Ranked, ...]:
        """Single errors of every part, the largest loss of the recovered picture first."""
        return rank_errors(self.offenders)

    def percentile_db(self, percent: float) -> float:
        """Return the PSNR that `percent` of the copies do not reach."""
        return float(np.percentile(self.copies.mean_db, percent))

    def share_at_least(self, psnr_db: float) -> float:
        """Return the yield: the share of copies with at least this PSNR."""
        return float((self.copies.mean_db >= psnr_db).mean())


def run_tolerance(
    lens: Lens, tolerances: Tolerances, run: ToleranceRun, watch: Watch | None = None
) -> ToleranceResult:
    """Draw copies of a lens and judge them.

    Args:
        lens: Nominal, focused as it is meant to be.
        tolerances: Widths of the errors.
        run: How.
        watch: Is told how many copies are done, and of how many; 0 once the design is judged.

    Raises:
        ContractError: If a field of the lens or of a copy loses its light.
    """
    judge = _judge(lens, tolerances, run)
    classes = tolerances.active()
    parts = _batches(run.copies)
    limits = _batches(run.limit_copies)
    singles, single_errors = single_deviations(lens, tolerances)
    singles = singles if run.ranking else ()
    total = run.copies + run.limit_copies * len(classes) + len(singles)
    done = 0

    def measure_all(parts: Iterable[Deviations]) -> Measured:
        nonlocal done
        results = []
        for deviations in parts:
            results.append(judge.measure(deviations))
            done += deviations.copies
            if watch is not None:
                watch(done, total)
        return _joined(results)

    def measure(widths: Tolerances, numbers: list[range], *, at_limits: bool) -> Measured:
        return measure_all(
            draw_deviations(lens, widths, some, run.seed, at_limits=at_limits) for some in numbers
        )

    nominal = judge.measure(no_deviations(lens))
    if watch is not None:
        watch(0, total)
    copies = measure(tolerances, parts, at_limits=False)
    losses = [
        _class_loss(tolerances, one, nominal, measure(tolerances.only(one), limits, at_limits=True))
        for one in classes
    ]
    single_parts = (single_errors.of_copies(some) for some in _batches(len(singles)))
    alone = measure_all(single_parts) if singles else None
    return ToleranceResult(
        lens=lens,
        tolerances=judge.tolerances,
        run=run,
        fields=judge.fields,
        kernel_px=judge.kernels.shape[-1],
        nominal=nominal,
        copies=copies,
        classes=tuple(sorted(losses, key=lambda loss: -float(loss.loss_db.mean()))),
        offenders=() if alone is None else _offenders(singles, nominal, alone),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Judge:
    """Fixed fields, patches and noise, and the nominal kernels (field, 3, k, k)."""

    lens: Lens
    tolerances: Tolerances
    run: ToleranceRun
    fields: tuple[tuple[float, float], ...]
    view: View
    color_weights: Tensor
    kernels: Tensor
    sharp: Tensor
    normal: Tensor

    def measure(self, deviations: Deviations) -> Measured:
        landing, gap_mm = _assembled(self.lens, self.tolerances, self.view, deviations)
        size = self.kernels.shape[-1]
        kernels, energy = copy_kernels(landing, self.color_weights, size, self.run.pitch_um)
        psnr = [self._psnr_db(of_copy.float()) for of_copy in kernels]
        return Measured(
            psnr_db=np.stack(psnr),
            spot_rms_mm=spot_rms_mm(landing).numpy(),
            refocus_mm=landing.refocus_mm.numpy(),
            gap_mm=gap_mm.numpy(),
            energy_kept=float(energy.min()),
        )

    def _psnr_db(self, kernels: Tensor) -> Array:
        """Photograph with kernels (field, 3, k, k), recover with the nominal ones: (field,)."""
        front, count = Front(kind="wiener"), self.run.patches
        with torch.no_grad():
            capture_kernels, filter_kernels = (
                k.repeat_interleave(count, 0) for k in (kernels, self.kernels)
            )
            recorded = capture(
                self.sharp, capture_kernels, Recorder(noise=self.run.noise), self.normal
            )
            recovered = front.planes(recorded, filter_kernels)[:, -3:]
            edge = (self.sharp.shape[-1] - self.run.patch_px) // 2
            inner = slice(edge, edge + self.run.patch_px)
            error = recovered.clamp(0, 1) - encode_srgb(self.sharp[..., inner, inner])
            square = error.double().square().mean((1, 2, 3)).clamp_min(1e-10)
            psnr: Array = (-10 * torch.log10(square)).reshape(-1, count).mean(1).numpy()
        return psnr


def _judge(lens: Lens, tolerances: Tolerances, run: ToleranceRun) -> _Judge:
    """Fix fields and patches; the window of the kernels holds the nominal and the first copies."""
    edge_slope = widest_tangent(lens.field_angles_rad, "tolerancing")
    fields = FIELDS if edge_slope > 0 else FIELDS[:1]
    view = _view(lens, fields, edge_slope, run.rays)
    tolerances = with_chosen_gap(lens, tolerances, view)
    waves = view.wavelengths_um.numpy()
    is_visible = waves.min() > _VISIBLE_UM[0] and waves.max() < _VISIBLE_UM[1]
    colors = (
        gaussian_response(waves).response
        if is_visible
        else np.full((3, waves.size), 1 / waves.size)
    )
    weights = torch.from_numpy(colors)

    def kernels(deviations: Deviations, size_px: int) -> Tensor:
        landing, _ = _assembled(lens, tolerances, view, deviations)
        return copy_kernels(landing, weights, size_px, run.pitch_um)[0]

    probes = draw_deviations(lens, tolerances, range(_PROBES), run.seed)
    none = no_deviations(lens)
    wide = [kernels(deviations, _LARGEST_KERNEL_PX) for deviations in (none, probes)]
    size = max(9, window_px(torch.cat(wide), _LOST_SHARE))
    front, rng = Front(kind="wiener"), np.random.default_rng(run.seed)
    inner = run.patch_px + 2 * front.margin_px
    source = open_source(
        run.pictures,
        picture_share=0.0 if run.pictures is None else 1.0,
        scenes=_SCENES,
        scene_px=_SCENE_PX,
    )
    count = len(fields) * run.patches
    crops = np.stack([source.draw_crop(rng, inner) for _ in range(count)])
    margin = (size - 1) // 2
    sharp = np.pad(crops, ((0, 0), (0, 0), (margin, margin), (margin, margin)), mode="wrap")
    normal = rng.standard_normal((count, 3, inner, inner), dtype=np.float32)
    return _Judge(
        lens=lens,
        tolerances=tolerances,
        run=run,
        fields=fields,
        view=view,
        color_weights=weights,
        kernels=kernels(none, size)[0].float(),
        sharp=torch.from_numpy(sharp.clip(0, 1)),
        normal=torch.from_numpy(normal),
    )


def _assembled(
    lens: Lens, tolerances: Tolerances, view: View, deviations: Deviations
) -> tuple[Landing, Tensor]:
    """Return the light of copies as assembly leaves them, and what it did to their gap (copy,)."""
    adjusted, gap_mm = with_adjusted_gap(lens, deviations, view, tolerances.compensator_gap)
    return land(lens, adjusted, view, tolerances.compensator), gap_mm


def _view(
    lens: Lens, fields: tuple[tuple[float, float], ...], edge_slope: float, rays: int
) -> View:
    return View(
        slopes=torch.tensor([edge_slope * share for share, _ in fields], dtype=torch.float64),
        azimuths_rad=torch.tensor([to_radians(a) for _, a in fields], dtype=torch.float64),
        wavelengths_um=torch.tensor(lens.wavelengths_um, dtype=torch.float64),
        # mirrored: the nominal kernels are as symmetric as the lens
        samples=both_halves(half_disc(rays // 2)),
    )


def _batches(count: int) -> list[range]:
    return [range(i, min(i + _BATCH, count)) for i in range(0, count, _BATCH)]


def _joined(parts: list[Measured]) -> Measured:
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("psnr_db", "spot_rms_mm", "refocus_mm", "gap_mm")
    }
    return Measured(**arrays, energy_kept=min(part.energy_kept for part in parts))


def _class_loss(
    tolerances: Tolerances, error_class: ErrorClass, nominal: Measured, measured: Measured
) -> ClassLoss:
    return ClassLoss(
        error_class=error_class,
        half_width=tolerances.of(error_class).half_width,
        loss_db=nominal.mean_db[0] - measured.mean_db,
        spot_growth_mm=float(
            (_overall(measured.spot_rms_mm) - _overall(nominal.spot_rms_mm)).mean()
        ),
    )


def _overall(spot_rms_mm: Array) -> Array:
    """Return the RMS radius (copy,) over all fields."""
    return np.asarray(np.sqrt((spot_rms_mm**2).mean(-1)))


def _offenders(
    singles: tuple[Single, ...], nominal: Measured, alone: Measured
) -> tuple[Offender, ...]:
    growth_mm = _overall(alone.spot_rms_mm) - _overall(nominal.spot_rms_mm)
    loss_db = nominal.mean_db[0] - alone.mean_db
    rows = zip(singles, loss_db.tolist(), growth_mm.tolist(), strict=True)
    offenders = [Offender(single=s, loss_db=db, spot_growth_mm=mm) for s, db, mm in rows]
    return tuple(sorted(offenders, key=lambda one: -one.spot_growth_mm))
