"""How far the geometric PSF is from the wave PSF: the table of docs/results/lens.md.

    python -m tools.psf_model_error

The Cooke triplet, closed down and defocused, on two pixel pitches; about 30 CPU seconds.
"""

from dataclasses import replace
from pathlib import Path

import torch

from camkit.models_def.optics.analysis.mtf import mtf_of_psf
from camkit.models_def.optics.analysis.psf_model import psf_model
from camkit.models_def.optics.analysis.spots import chief_landings
from camkit.models_def.optics.analysis.wave_psf import trace_wave_psf
from camkit.models_def.optics.prescription import Lens, read_prescription, with_focus_shift
from camkit.models_def.optics.psf import trace_psf

LENS = Path(__file__).parent.parent / "models_def" / "prescriptions" / "cooke-triplet-f5.toml"
DIAMETERS_MM = (10.0, 4.0)
SHIFTS_MM = (0.0, 0.2, 0.4)
FIELDS_DEG = (0.0, 20.0)
WINDOWS = ((6.0, 25), (2.0, 49))
FREQUENCIES = 26


def main() -> None:
    """Print the table."""
    lens = read_prescription(LENS)
    print("RMS / Airy   pitch, um   largest MTF difference")
    for diameter in DIAMETERS_MM:
        for shift in SHIFTS_MM:
            opened = replace(lens, aperture_value=diameter)
            for row in rows(with_focus_shift(opened, shift)):
                print("{:10.2f}   {:9.0f}   {:.3f}".format(*row))


def rows(lens: Lens) -> list[tuple[float, float, float]]:
    """Return (RMS over Airy radius, pitch, MTF difference) of every field and pitch."""
    slopes = torch.tan(torch.deg2rad(torch.tensor(FIELDS_DEG, dtype=torch.float64)))
    wave = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    heights = chief_landings(lens, slopes, wave, "stop")[:, 0]
    model = psf_model(lens, slopes, wave)
    found = []
    for pitch_um, side in WINDOWS:
        waves = trace_wave_psf(lens, slopes, wave, side, pitch_um)
        rays = trace_psf(lens, heights, wave, side, pitch_um)
        cycles = torch.linspace(0, 500 / pitch_um, FREQUENCIES, dtype=torch.float64)
        one = mtf_of_psf(waves.kernels, pitch_um, cycles, 1 / waves.energy_kept)
        other = mtf_of_psf(rays.kernels, pitch_um, cycles)
        apart = torch.maximum(
            (one.tangential - other.tangential).abs().amax(-1),
            (one.sagittal - other.sagittal).abs().amax(-1),
        )
        ratio = (model.blur_mm / model.airy_mm)[:, 0]
        found += [(float(r), pitch_um, float(a)) for r, a in zip(ratio, apart, strict=True)]
    return found


if __name__ == "__main__":
    main()
