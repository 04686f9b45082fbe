"""Any optics frozen: what stands before a sensor becomes what a bundle holds.

Optics -> by samples, judged by the Wiener bank    a lens, measured kernels      (freeze)
       -> by streaks, or kernels that are wide     a plate                       (diffraction)
       -> by peaks and the haze beside them        a lens, where that is wanted  (thin)
       -> Freezing: FrozenOptics, facts, kernels off the design point
"""

from dataclasses import dataclass, replace
from typing import Final

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.sensor import ColorSensor
from camkit.bundle.stages import Wiener
from camkit.caller import option_text
from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.optics.diffraction.freezing import WINDOW, freeze_plate
from camkit.models_def.optics.diffraction.plate_optics import PlateOptics
from camkit.models_def.optics.freezable_optics import Optics
from camkit.models_def.optics.freeze import (
    LOSS_LIMIT_DB,
    Facts,
    Tell,
    freeze_quickly,
    freeze_samples,
)
from camkit.models_def.optics.frozen import FreezeGrid, freeze_stress
from camkit.models_def.optics.lens_optics import LensOptics
from camkit.models_def.optics.thin.distances import freeze_distances
from camkit.models_def.optics.thin.hazy_freezing import freeze_hazy
from camkit.progress import note, working
from camkit.psf import depth_name

LEAST_WAVE_ENERGY: Final = 0.97
"""Share of the light that kernels of waves hold at least, where the largest side ends them: the
rings of an Airy pattern hold 0.5 % beyond 40 wavelengths times F-number."""
WAVE_SPARE: Final = 0.8
"""Share of the light that kernels may lose, for which waves are summed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FreezeRequest:
    """Settings of freezing optics.

    Attributes:
        sensor: Size, pitch, response and noise.
        bank: The Wiener bank that judges samples; None for the usual one.
        depths_mm: Object distances, increasing; empty for those of the optics.
        limit_db: Mean loss allowed for the samples; None for `LOSS_LIMIT_DB`.
        energy: Least share of the light of every colour inside the kernels; None for 0.995, of a
            plate 0.999 as far as its window holds that.
        max_side_px: Largest kernel side, odd; None for 151, of a plate 401.
        focus_um: How far the sensor is moved to both sides for kernels of cameras whose focus is
            measured; 0 for none. A lens alone.
        haze: Whether only sharp peaks are kernels, with the haze beside them. A lens alone; the
            rest is chosen then, but for the sensor.
        stress: Whether kernels off the design point are frozen too.
        quick: Whether nothing is searched: see `freeze_quickly`. A plate is frozen as ever.
        psf_model: Of a lens: rays, waves, or empty for what `psf_model` finds.
    """

    sensor: ColorSensor
    bank: Wiener | None = None
    depths_mm: tuple[float, ...] = ()
    limit_db: float | None = None
    energy: float | None = None
    max_side_px: int | None = None
    focus_um: float = 0.0
    haze: bool = False
    stress: bool = False
    quick: bool = False
    psf_model: str = ""

    def __post_init__(self) -> None:
        names = ("depths_mm", "limit_db", "energy", "max_side_px", "focus_um", "psf_model")
        options = [option_text(name) for name in names if getattr(self, name)]
        if self.haze and options:
            raise ContractError(f"{option_text('haze')} conflicts with {', '.join(options)}")
        searched = ("limit_db", "focus_um", "haze")
        options = [option_text(name) for name in searched if getattr(self, name)]
        if self.quick and options:
            raise ContractError(f"{option_text('quick')} conflicts with {', '.join(options)}")

    def grid(self, base: FreezeGrid) -> FreezeGrid:
        """Return a grid with what is asked for."""
        return replace(
            base,
            depths_mm=self.depths_mm,
            energy=base.energy if self.energy is None else self.energy,
            max_side_px=self.max_side_px or base.max_side_px,
            # who says how much is wanted gets no less
            least_energy=base.least_energy if self.energy is None else None,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Freezing:
    """Optics that were frozen.

    Attributes:
        optics: For a bundle.
        facts: What was kept and what it costs, a flat mapping for its manifest.
        stress: Kernels off the design point, where they were asked for.
    """

    optics: FrozenOptics
    facts: Facts
    stress: FrozenOptics | None = None


def freeze_optics(optics: Optics, request: FreezeRequest, *, tell: Tell = note) -> Freezing:
    """Freeze optics.

    Args:
        optics: A lens, a plate, or a PSF that was measured; see `read_optics`.
        request: How.
        tell: Takes a line for everything that was tried.

    Raises:
        ContractError: If the optics are wrong, or nothing that may be tried holds their light or
            keeps the loss.
        UnsupportedError: If something is asked for that is known of a lens alone.
    """
    if request.haze:
        return _hazy(optics, request, tell)
    if request.focus_um and not isinstance(optics, LensOptics):
        raise UnsupportedError(
            f"only a lens is traced with its sensor moved; leave {option_text('focus_um')} out"
        )
    base = FreezeGrid()
    if isinstance(optics, LensOptics):
        optics = _modelled(optics, request, tell)
        if optics.regime == "waves":
            base = replace(base, least_energy=LEAST_WAVE_ENERGY)
    elif request.psf_model:
        raise UnsupportedError(
            f"only a lens is traced by rays or waves; leave {option_text('psf_model')} out"
        )
    with working("freezing the optics"):
        if isinstance(optics, PlateOptics):
            grid = request.grid(WINDOW)
            frozen, facts = freeze_plate(optics, sensor=request.sensor, grid=grid, tell=tell)
        elif request.quick:
            grid = request.grid(base)
            frozen, facts = freeze_quickly(optics, sensor=request.sensor, grid=grid, tell=tell)
        else:
            grid = request.grid(base)
            frozen, facts = freeze_samples(
                optics,
                sensor=request.sensor,
                settings=request.bank,
                limit_db=LOSS_LIMIT_DB if request.limit_db is None else request.limit_db,
                grid=grid,
                focus_um=request.focus_um,
                tell=tell,
            )
    stress = None
    if request.stress:
        stress = FrozenOptics(psf=freeze_stress(optics, request.sensor, grid).psf)
    return Freezing(optics=frozen, facts=facts, stress=stress)


def _modelled(lens: LensOptics, request: FreezeRequest, tell: Tell) -> LensOptics:
    """Return the lens with the PSF model that it takes."""
    modelled = lens.by_rule(request.sensor, regime=request.psf_model)
    if request.energy is not None:
        modelled = replace(modelled, light=1 - WAVE_SPARE * (1 - request.energy))
    tell(f"{lens.name}: PSF by {modelled.regime}")
    if modelled.lost_diffraction:
        tell(f"{lens.name}: {modelled.lost_diffraction}")
    return modelled


@working("freezing peaks and haze of the lens")
def _hazy(optics: Optics, request: FreezeRequest, tell: Tell) -> Freezing:
    """Freeze the peaks of a lens and the haze beside them, at other distances too if wanted."""
    if not isinstance(optics, LensOptics):
        raise UnsupportedError(f"{option_text('haze')} is for lenses only; leave it out")
    frozen, facts = freeze_hazy(optics.lens, request.sensor, tell=tell)
    if optics.lens.state:
        facts["configuration"] = optics.lens.state
    stress = None
    if request.stress:
        stress = freeze_distances(optics.lens, request.sensor, tell=tell)
        facts["distances"] = ", ".join(map(depth_name, stress.psf.depths_mm))
    return Freezing(optics=frozen, facts=facts, stress=stress)
