"""A lens as freezing sees it: traced wherever it is asked for."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import torch

from camkit.bundle.sensor import ColorSensor
from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.optics.analysis.model_psf import WAVE_LIGHT, model_psf
from camkit.models_def.optics.analysis.psf_model import (
    WAVE_BELOW,
    PsfRegime,
    checked_regime,
    sensor_model,
)
from camkit.models_def.optics.asymmetric.place_psf import trace_place_psf
from camkit.models_def.optics.asymmetric.turning import round_part
from camkit.models_def.optics.distortion import trace_distortion
from camkit.models_def.optics.focus import focus_shift_mm
from camkit.models_def.optics.freezable_optics import (
    FieldLayout,
    FloatGrid,
    grid_layout,
    radial_layout,
)
from camkit.models_def.optics.frozen import corner_height_mm
from camkit.models_def.optics.kernel_bank import focused_copies
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens, grooves_of, require_round, with_focus_shift
from camkit.models_def.optics.psf import TracedPsf, with_object_distance
from camkit.models_def.optics.render.illumination import relative_illumination_at
from camkit.radial import RadialDistortion
from camkit.units import UM_PER_MM

RAYS: Final = 4096
GRID_COUNTS: Final = (7, 5)
GRID_SHARES: Final = (0.83, 0.56)
"""Half sides of the grid of a lens that is not round, of the corner's distance: a 3:2 sensor."""
SPREAD_COPIES: Final = 64
SPREADS: Final = 2.0
SPREAD_SEED: Final = 7
_STEP_UM: Final = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LensOptics:
    """A lens; fulfils `camkit.models_def.optics.freezable_optics.Optics`.

    Distortion and illumination are those at the lens's own object distance.

    Attributes:
        lens: The prescription.
        rays: In half the pupil, per wavelength traced.
        regime: Whether kernels are traced by rays or summed from waves.
        blur_airy: Least blur over Airy radius, by which the rule decided; None where it did not.
        light: Share of the light that waves are summed for, see `model_psf`.
    """

    lens: Lens
    rays: int = RAYS
    regime: PsfRegime = "rays"
    blur_airy: float | None = None
    light: float = WAVE_LIGHT

    @property
    def name(self) -> str:
        """Name of the lens."""
        return self.lens.name

    @property
    def facts(self) -> Mapping[str, float | str]:
        """Name, focal length, F-number, configuration, PSF model, and the blur that chose it."""
        data = paraxial_data(self.lens)
        facts: dict[str, float | str] = {"lens": self.lens.name, "efl_mm": data.efl_mm}
        facts |= {"f_number": abs(data.f_number), "psf_model": self.regime}
        if self.lens.state:
            facts["configuration"] = self.lens.state
        if self.blur_airy is not None:
            facts["blur_airy"] = self.blur_airy
        return facts

    def by_rule(self, sensor: ColorSensor, *, regime: str = "") -> "LensOptics":
        """Return the lens with the PSF model that it needs before a sensor, or a given one.

        Raises:
            ContractError: If there is no such model.
            UnsupportedError: If waves are wanted of a lens with grooves or of an unround one.
        """
        own_regime = checked_regime(regime)
        if own_regime == "waves" and grooves_of(self.lens):
            raise UnsupportedError("the light of grooves is no smooth wave; take rays")
        if own_regime == "waves":
            require_round(self.lens, "a sum of waves")
        model = sensor_model(self.lens, corner_height_mm(sensor), *sensor.response_arrays())
        least = float(model.ratio.min())
        return replace(
            self,
            regime=own_regime or model.regime,
            blur_airy=least if math.isfinite(least) else None,
        )

    @property
    def lost_diffraction(self) -> str:
        """A line where rays were asked for though the rule takes waves; empty otherwise."""
        blur = math.inf if self.blur_airy is None else self.blur_airy
        could_be_waves = self.lens.is_round and not grooves_of(self.lens)
        if self.regime == "waves" or blur >= WAVE_BELOW or not could_be_waves:
            return ""
        return (
            f"rays leave out diffraction, which counts here: the blur is {blur:.2g} Airy radii, "
            f"less than {WAVE_BELOW:g}; the rule takes waves"
        )

    @property
    def depths_mm(self) -> tuple[float, ...]:
        """The object distance of the prescription."""
        return (self.lens.object_distance_mm,)

    @property
    def focus_mm(self) -> float:
        """The object distance of the prescription."""
        return self.lens.object_distance_mm

    @property
    def reference_wavelength_um(self) -> float:
        """The reference wavelength of the prescription."""
        return self.lens.reference_wavelength_um

    @property
    def wavelengths_um(self) -> None:
        """A lens may be traced at any wavelength."""
        return

    def layout(self, corner_mm: float, fields: int) -> FieldLayout:
        """Return heights from the axis to the corner, evenly spaced; a grid if it is not round."""
        if self.lens.is_round:
            return radial_layout(np.linspace(0.0, corner_mm, fields))
        half = [corner_mm * share for share in GRID_SHARES]
        columns, rows = (np.linspace(-h, h, n) for h, n in zip(half, GRID_COUNTS, strict=True))
        return grid_layout(columns, rows)

    def kernels(
        self,
        fields: FieldLayout,
        wavelengths_um: FloatGrid,
        *,
        depth_mm: float,
        side_px: int,
        pitch_um: float,
    ) -> TracedPsf:
        """Trace the kernels at heights along +y, or at the places of a grid.

        The sensor stays where the lens has it.

        Raises:
            ContractError: If a round lens is asked for other places, or no light reaches a kernel.
        """
        lens = with_object_distance(self.lens, depth_mm)
        if not lens.is_round:
            places = list(zip(fields.x_mm.tolist(), fields.y_mm.tolist(), strict=True))
            waves = torch.from_numpy(wavelengths_um)
            with torch.no_grad():
                return trace_place_psf(lens, places, waves, side_px, pitch_um, rays=self.rays)
        if fields.symmetry != "radial":
            raise ContractError("a lens of revolution is traced along +y; other places are turned")
        with torch.no_grad():
            return model_psf(
                lens,
                torch.from_numpy(fields.y_mm),
                torch.from_numpy(wavelengths_um),
                side_px,
                pitch_um,
                regime=self.regime,
                rays=self.rays,
                light=self.light,
            )

    def distortion(self, radius_mm: float, channels: int) -> RadialDistortion:
        """Trace the distortion at the reference wavelength; see `trace_distortion`.

        Of a lens that is not round it is that of its round part: free phases left out, elements
        centred. So is the illumination.
        """
        return trace_distortion(round_part(self.lens), radius_mm, channels=channels)

    def illumination(self, fields: FieldLayout) -> FloatGrid:
        """Trace the relative illumination; the first place is the axis."""
        heights = fields.y_mm
        if fields.symmetry != "radial":
            heights = np.concatenate([np.zeros(1), fields.heights_mm])
        light = relative_illumination_at(round_part(self.lens), torch.from_numpy(heights))
        shares = np.asarray(light.numpy() / float(light[0]), dtype=np.float64)
        return shares[-fields.count :]

    def copies(self, count: int, seed: int) -> "tuple[LensOptics, ...]":
        """Return the nominal lens and fabricated copies, each focused when it was assembled."""
        lenses = focused_copies(self.lens, count, seed)
        return tuple(replace(self, lens=lens) for lens in lenses)

    def refocused(self, focus_um: float) -> "LensOptics":
        """Return the lens before a sensor that was moved away from it."""
        return replace(self, lens=with_focus_shift(self.lens, focus_um / UM_PER_MM))

    def focus_range_um(self) -> float:
        """Return the focus range of nearly all fabricated copies about the nominal one.

        Twice the standard deviation of where spots are smallest, seen from the sensor as it stands
        after assembly, in whole steps of 5 um.
        """
        lenses = focused_copies(self.lens, 1 + SPREAD_COPIES, SPREAD_SEED)
        nominal_mm, *best_mm = (focus_shift_mm(lens, "spot") for lens in lenses)
        spread_um = float(np.std(np.array(best_mm) - nominal_mm)) * UM_PER_MM
        return _STEP_UM * max(1, math.ceil(SPREADS * spread_um / _STEP_UM))
