"""How far the geometric PSF is from the wave PSF: the first table of docs/results/lens.md.

    python -m tools.psf_model_error

Lenses stopped down and defocused, three pixel pitches, five wavelengths of green; two CPU minutes.
"""

from dataclasses import replace
from typing import Final

import torch

from camkit.errors import ContractError
from camkit.models_def.optics.analysis.lens_waves import wave_psf
from camkit.models_def.optics.analysis.mtf import mtf_of_psf
from camkit.models_def.optics.analysis.psf_model import psf_model
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.prescription import with_focus_shift
from camkit.models_def.optics.psf import trace_psf
from camkit.models_def.optics.spot import chief_heights

LENSES: Final = {
    "cooke-triplet-f5": (5.0, 12.5),
    "double-gauss": (2.0, 2.8, 8.0),
    "aca254-050-a": (4.0, 8.0),
    "duet": (4.0, 8.0),
}
SHIFTS_MM: Final = (0.0, 0.1, 0.2)
FIELDS: Final = (0.0, 0.35, 0.8)
WINDOWS: Final = ((1.5, 129), (3.76, 65), (6.0, 45))
GREEN: Final = torch.tensor([0.50, 0.52, 0.54, 0.56, 0.58], dtype=torch.float64)
WIDEST: Final = 25.0
LEAST_LIGHT: Final = 0.995


def main() -> None:
    """Print a line for each kernel, from the sharpest on."""
    rows = []
    for name, stops in LENSES.items():
        lens = find_lens(name)
        largest = max(lens.field_angles_rad)
        slopes = torch.tan(largest * torch.tensor(FIELDS, dtype=torch.float64))
        for stop in stops:
            stopped = replace(lens, aperture_kind="f_number", aperture_value=stop)
            for shift_mm in SHIFTS_MM:
                moved = with_focus_shift(stopped, shift_mm)
                together = torch.full((1, len(GREEN)), 1 / len(GREEN), dtype=torch.float64)
                ratios = psf_model(moved, slopes, GREEN, together).ratio[:, 0]
                for slope, ratio in zip(slopes, ratios.tolist(), strict=True):
                    if ratio < WIDEST:
                        rows += [(ratio, *row) for row in _errors(moved, slope[None])]
    for ratio, pitch_um, error in sorted(rows):
        print(f"{ratio:6.2f} {pitch_um:5.2f} {error:.3f}")


def _errors(lens, slope):  # type: ignore[no-untyped-def]
    heights = chief_heights(lens, slope)
    for pitch_um, side_px in WINDOWS:
        rays = trace_psf(lens, heights, GREEN, side_px, pitch_um)
        if float(rays.energy_kept.min()) < LEAST_LIGHT:
            continue
        try:
            waves = wave_psf(lens, slope, GREEN, side_px, pitch_um)
        except ContractError:
            continue
        cycles = torch.linspace(0, 500 / pitch_um, 26, dtype=torch.float64)
        one = mtf_of_psf(waves.kernels, pitch_um, cycles, 1 / waves.energy_kept)
        other = mtf_of_psf(rays.kernels, pitch_um, cycles)
        apart = [
            float((a - b).abs().max())
            for a, b in ((one.tangential, other.tangential), (one.sagittal, other.sagittal))
        ]
        yield pitch_um, max(apart)


if __name__ == "__main__":
    main()
