"""What restoring by the wave PSF gains over rays: the second table of docs/results/lens.md.

    camkit recipe double-gauss --sensor 4000x3000@3.76um --f-number 8 --focus-m inf -o F/cam.toml
    camkit freeze F/cam-lens.toml --recipe F/cam.toml --quick --psf-model waves -o F/waves.safetensors
    camkit freeze F/cam-lens.toml --recipe F/cam.toml --quick --psf-model rays -o F/rays.safetensors
    python -m tools.psf_model_gain F PICTURES

Pictures are blurred by the kernels of waves, in three planes without a mosaic, given the noise of
the sensor, and restored by the Wiener filter with the kernels of waves and of rays.
"""

import sys
from pathlib import Path

import cv2
import numpy as np
import torch

from camkit.bundle.psf_file import read_psf
from camkit.bundle.stages import Wiener
from camkit.models_def.optics.sampling_loss import _convolve, _noisy
from camkit.models_def.sensors.tone import encode_srgb
from camkit.models_def.sensors.wiener import PRIOR_EXPONENT, PRIOR_SCALE, wiener_restore
from camkit.models_def.training.kind import read_recipe
from camkit.runtime.bank.psf import color_kernels


def main() -> None:
    """Print PSNR of sRGB values, the mean over pictures and three heights, at two ISO speeds."""
    folder, pictures = Path(sys.argv[1]), sorted(Path(sys.argv[2]).glob("*.jpg"))[:8]
    sensor = read_recipe(folder / "cam.toml").sensor
    bank = {}
    for name in ("waves", "rays"):
        lookup = color_kernels(read_psf(folder / f"{name}.safetensors"), *sensor.response_arrays())
        bank[name] = [torch.from_numpy(lookup.at(0.0, y))[None].float() for y in (0.0, 4.0, 7.0)]
    settings = Wiener(prior_scale=PRIOR_SCALE, prior_exponent=PRIOR_EXPONENT).alone()
    middle = (..., slice(56, -56), slice(56, -56))
    scores: dict[tuple[float, str], list[float]] = {}
    for picture in pictures:
        image = cv2.imread(str(picture))[..., ::-1].astype(float) / 255
        top, left = (image.shape[0] - 512) // 2, (image.shape[1] - 512) // 2
        coded = image[top : top + 512, left : left + 512].transpose(2, 0, 1)
        light = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
        sharp = torch.from_numpy(light)[None].float()
        for place in range(3):
            for step in (1.0, 8.0):
                blurred = _convolve(sharp, bank["waves"][place])
                noisy, shot, read = _noisy(blurred, sensor, step, 5)
                restored = {
                    name: wiener_restore(noisy, kernels[place], shot, read, settings)
                    for name, kernels in bank.items()
                }
                for name, result in {"capture": noisy, **restored}.items():
                    apart = encode_srgb(result.clamp(0, 1)) - encode_srgb(sharp)
                    error = float(apart[middle].square().mean())
                    scores.setdefault((step, name), []).append(-10 * np.log10(error))
    for (step, name), values in scores.items():
        print(f"{step:g} x base ISO, {name}: {np.mean(values):.2f} dB")


if __name__ == "__main__":
    main()
