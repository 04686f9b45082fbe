"""Facts about a plate before its lens, computed, and their JSON."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor

from camkit.bundle.sensor import ColorSensor
from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.plate import Plate
from camkit.models_def.optics.diffraction.plate_optics import REFERENCE_UM, plate_kernels
from camkit.models_def.optics.diffraction.shares import (
    Shares,
    Streak,
    find_streaks,
    shares,
    side_for,
    with_reach,
)
from camkit.models_def.optics.diffraction.wave import strehl
from camkit.runtime.bank.psf import wavelength_weights
from camkit.units import MM_PER_M

WAVELENGTHS: Final = 13
"""Of which the colours are made."""
WINDOW_SHARE: Final = 0.995
"""Of the light of every colour, by the side that is told."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Look:
    """Sensor, window and sampling for the look at a plate.

    Attributes:
        sensor: Pitch and colours.
        depth_mm: Of the point light; None for the focus.
        side_px: Odd side of the window.
    """

    sensor: ColorSensor
    depth_mm: float | None = None
    side_px: int = 401


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlateFacts:
    """A plate and what becomes of a point light behind it.

    Attributes:
        plate: As read.
        depth_mm: Of the light.
        pitch_um: Of the pixels.
        channels: Names of the colours.
        psf: (colour, side, side), shares of the light.
        bare: The same of the lens without the plate.
        streaks: At `REFERENCE_UM`, brightest first.
        of_colour: (colour,) where its light goes, by streaks of the same angles.
        of_bare: The same of the bare lens, by the same masks.
        strehl: At `REFERENCE_UM`.
        bare_strehl: Of the bare lens.
        psf_side_px: What holds `HELD` of the light of every colour, or the whole window.
    """

    plate: Plate
    depth_mm: float
    pitch_um: float
    channels: tuple[str, ...]
    psf: Tensor
    bare: Tensor
    streaks: tuple[Streak, ...]
    of_colour: tuple[Shares, ...]
    of_bare: tuple[Shares, ...]
    strehl: float
    bare_strehl: float
    psf_side_px: int


def analyse(plate: Plate, look: Look) -> PlateFacts:
    """Compute everything.

    Raises:
        ContractError: If the window or the depth is none, or the plate's cells are too wide.
        UnsupportedError: If the response of the sensor is not known.
    """
    depth_mm = plate.bench.focus_mm if look.depth_mm is None else look.depth_mm
    if not depth_mm > 0:
        raise ContractError(f"a depth must be > 0; got {depth_mm / MM_PER_M:g} m")
    pitch_um = look.sensor.pixel_pitch_um
    psf, bare = (_colours(plate, look, depth_mm, bare=bare) for bare in (False, True))
    single, single_bare = (
        _light(plate, (REFERENCE_UM,), look, depth_mm, bare=bare)[0] for bare in (False, True)
    )
    streaks = find_streaks(single, single_bare)
    masks = [with_reach(streaks, *pair) for pair in zip(psf, bare, strict=True)]
    ratios = [
        strehl(
            heights, plate.index(REFERENCE_UM), REFERENCE_UM, bench=plate.bench, depth_mm=depth_mm
        )
        for heights in (plate.made_um, torch.zeros_like(plate.height_um))
    ]
    return PlateFacts(
        plate=plate,
        depth_mm=depth_mm,
        pitch_um=pitch_um,
        channels=tuple(look.sensor.channels),
        psf=psf,
        bare=bare,
        streaks=streaks,
        of_colour=tuple(shares(one, mask) for one, mask in zip(psf, masks, strict=True)),
        of_bare=tuple(shares(one, mask) for one, mask in zip(bare, masks, strict=True)),
        strehl=ratios[0],
        bare_strehl=ratios[1],
        psf_side_px=side_for(psf, WINDOW_SHARE),
    )


def to_json(facts: PlateFacts) -> dict[str, Any]:
    """Return what stands on the page as numbers; shares are rounded to 1e-5."""
    return {
        "name": facts.plate.name,
        "depth_m": facts.depth_mm / MM_PER_M if np.isfinite(facts.depth_mm) else "inf",
        "pitch_um": facts.pitch_um,
        "psf_side_px": facts.psf_side_px,
        "streaks": [
            {"angle_deg": one.angle_deg, "reach_px": one.reach_px} for one in facts.streaks
        ],
        "strehl": round(facts.strehl, 5),
        **_shares(facts.channels, facts.of_colour),
        "bare": {
            "strehl": round(facts.bare_strehl, 5),
            **_shares(facts.channels, facts.of_bare),
        },
    }


def _shares(channels: tuple[str, ...], shares: tuple[Shares, ...]) -> dict[str, dict[str, float]]:
    return {
        f"{part}_share": {
            channel: round(getattr(one, part), 5)
            for channel, one in zip(channels, shares, strict=True)
        }
        for part in ("core", "streak", "haze")
    }


def _colours(plate: Plate, look: Look, depth_mm: float, *, bare: bool) -> Tensor:
    """Return the PSF (colour, side, side) of the sensor's colours, flat spectrum."""
    response_um, response = look.sensor.response_arrays()
    waves_um = np.linspace(response_um[0], response_um[-1], WAVELENGTHS)
    weights = torch.from_numpy(wavelength_weights(waves_um, response_um, response))
    light = _light(plate, tuple(waves_um.tolist()), look, depth_mm, bare=bare)
    return torch.einsum("cw,wyx->cyx", weights, light)


def _light(
    plate: Plate, waves_um: tuple[float, ...], look: Look, depth_mm: float, *, bare: bool
) -> Tensor:
    kernels = plate_kernels(
        plate,
        depths_m=(depth_mm / MM_PER_M,),
        wavelengths_um=waves_um,
        side_px=look.side_px,
        pitch_um=look.sensor.pixel_pitch_um,
        bare=bare,
    )
    return torch.from_numpy(kernels[0]).double()
