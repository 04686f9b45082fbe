"""Does a plate without the regulariser collapse to a point? By physics, without a network.

    python -m tools.plate.collapse --out-dir out/collapse --steps 200

A map of rank 3 is designed by eq. (5.12). From there every cell is free and the regulariser is
gone, as in figure 5.4 of the thesis; besides, a map of rank 3 begins without it. What moves the
plate is how well lamps are recovered by one of two readers:

    blind     looks at the clipped capture alone: eq. (5.11) between it and the scene, as a network
              sees the world before it has learnt to read streaks
    linear    the best linear estimate of a lamp's pixels from all that is not clipped around it:
              its expected error is known in closed form, and so is that of everything else

References: Sun 2021, section 5.4.1.
"""

import argparse
import json
import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor

from camkit.models_def.design.plate.goal import masks_of, reached
from camkit.models_def.design.plate.loop import PlateLoop
from camkit.models_def.design.plate.maps import begin_map
from camkit.models_def.design.plate.recipe import PlateRecipe, to_plate_recipe
from camkit.models_def.optics.diffraction.heights import FullMap
from camkit.models_def.optics.diffraction.map_numbers import HeightMap
from camkit.models_def.optics.diffraction.wave import PixelGrid, plate_psf, strehl

WAVE_UM: Final = 0.55
INDEX: Final = 1.4599
PEAK: Final = 256.0
CLIPPED: Final = 0.015
"""Share of the picture."""
HALF_PX: Final = 68
SEEN_PX: Final = 60
RADII_PX: Final = (3, 8)
LAMP: Final = 30.0
"""Standard deviation of a lamp's pixels, in units of white."""
TEXTURE: Final = 0.02
"""What is not known of the picture beside a lamp: standard deviation."""
NOISE: Final = 0.002
PICTURE_VARIANCE: Final = 0.05
SCENE_PX: Final = 192
Reader = Callable[[Tensor], Tensor]


def small_recipe(cells: int, steps: int, seed: int) -> PlateRecipe:
    """Return the thesis's design with wider cells and shorter streaks, in green."""
    return to_plate_recipe(
        {
            "name": "small",
            "cells": cells,
            "bench": {"diameter_mm": 9.162, "focal_length_mm": 50.0, "focus_mm": 5000.0},
            "map": {"kind": "rank", "rank": 3, "start": 0.3},
            "goal": {"far_px": 60.0},
            "pixels": {"side_px": 2 * HALF_PX + 1, "wavelengths_um": [WAVE_UM], "samples": 2},
            "schedule": {"steps": steps, "rate": 0.05, "log_steps": steps, "seed": seed},
        }
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lamp:
    """A round lamp and what is seen around it.

    Attributes:
        index: (seen, site) of the PSF's pixel that carries a site's light to a seen pixel.
        prior: (site, site) covariance of the lamp.
    """

    index: Tensor
    prior: Tensor


def lamp_of(radius_px: int) -> Lamp:
    """Return a lamp; pixels up to 2 px beside it are clipped by its tail."""
    place = torch.arange(-SEEN_PX, SEEN_PX + 1)
    y, x = torch.meshgrid(place, place, indexing="ij")
    distance = (y.double() ** 2 + x.double() ** 2).sqrt()
    sites = torch.stack([axis[distance <= radius_px] for axis in (y, x)], 1)
    seen = torch.stack([axis[distance > radius_px + 2] for axis in (y, x)], 1)
    offset = seen[:, None] - sites[None] + HALF_PX
    apart = (sites[:, None] - sites[None]).double().norm(dim=-1)
    smooth = torch.exp(-((apart / max(1.0, radius_px / 2)) ** 2) / 2)
    prior = LAMP**2 * (0.9 * smooth + 0.1 * torch.eye(len(sites), dtype=torch.float64))
    return Lamp(index=offset[..., 0] * (2 * HALF_PX + 1) + offset[..., 1], prior=prior)


def linear_error(psf: Tensor, lamps: tuple[Lamp, ...]) -> Tensor:
    """Return the expected squared error of a picture under the best linear estimate.

    Args:
        psf: (side, side) of 2 HALF_PX + 1.
        lamps: Of equal weight.
    """
    total = _picture_error(psf) * (1 - CLIPPED)
    for lamp in lamps:
        carried = psf.double().flatten()[lamp.index]
        known = carried.T @ carried / (TEXTURE**2 + NOISE**2)
        left = torch.linalg.inv(torch.linalg.inv(lamp.prior) + known)
        of_lamp = left.diagonal().mean()
        beside = torch.einsum("ms,st,mt->", carried, left, carried) / len(carried)
        total = total + (CLIPPED * of_lamp + (1 - CLIPPED) * beside) / len(lamps)
    return total


def _picture_error(psf: Tensor) -> Tensor:
    """Return the error of a Wiener filter on a picture whose power falls with frequency."""
    side = 256
    fx = torch.fft.fftfreq(side, dtype=torch.float64)
    power = 1 / (fx[:, None] ** 2 + fx[None, :] ** 2 + 1e-4) ** 1.25
    power = power * (PICTURE_VARIANCE / power.mean())
    shown = torch.fft.fft2(psf.double(), s=(side, side)).abs() ** 2
    error: Tensor = (power * NOISE**2 / (shown * power + NOISE**2)).mean()
    return error


def scenes_of(count: int, seed: int) -> Tensor:
    """Return (count, h, w) smooth pictures with lamps over CLIPPED of their pixels."""
    rng = np.random.default_rng(seed)
    place = np.arange(SCENE_PX)
    made = []
    for _ in range(count):
        spectrum = np.fft.fft2(rng.standard_normal((SCENE_PX, SCENE_PX)))
        fx = np.fft.fftfreq(SCENE_PX)
        picture = np.fft.ifft2(spectrum / (fx[:, None] ** 2 + fx**2 + 1e-3) ** 0.8).real
        picture = 0.05 + 0.5 * (picture - picture.min()) / np.ptp(picture)
        while (picture > 1).mean() < CLIPPED:
            y, x = rng.integers(10, SCENE_PX - 10, 2)
            inside = (place[:, None] - y) ** 2 + (place - x) ** 2 <= rng.integers(2, 7) ** 2
            picture = np.where(inside, 2 ** rng.uniform(1, 8), picture)
        made.append(picture)
    return torch.from_numpy(np.stack(made))


def captures(psf: Tensor, scenes: Tensor) -> Tensor:
    """Return what a sensor shows of scenes, clipped at white."""
    size = [SCENE_PX + 2 * HALF_PX] * 2
    full: Tensor = torch.fft.irfft2(
        torch.fft.rfft2(scenes, s=size) * torch.fft.rfft2(psf.double(), s=size), s=size
    )
    return full[:, HALF_PX:-HALF_PX, HALF_PX:-HALF_PX].clamp(1e-6, 1)


def blind_loss(psf: Tensor, scenes: Tensor) -> Tensor:
    """Return eq. (5.11) between clipped captures and scenes."""
    return torch.nn.functional.huber_loss(captures(psf, scenes).sqrt(), scenes.sqrt())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trial:
    """What all runs share."""

    recipe: PlateRecipe
    lamps: tuple[Lamp, ...]
    scenes: Tensor

    def psf(self, height_um: Tensor) -> Tensor:
        """Return the PSF (side, side) of heights."""
        pixels = self.recipe.pixels
        grid = PixelGrid(
            side_px=pixels.side_px, pitch_um=pixels.pitch_um, samples=pixels.samples or None
        )
        bench = self.recipe.bench
        return plate_psf(height_um, INDEX, WAVE_UM, bench=bench, grid=grid, depth_mm=bench.focus_mm)

    def row(self, height_um: Tensor) -> dict[str, float]:
        """Return what a plate does with the light, and what both readers make of it."""
        with torch.no_grad():
            psf, bare = self.psf(height_um), self.psf(torch.zeros_like(height_um))
            masks = masks_of(self.recipe.goal, self.recipe.pixels.side_px)
            found = reached(psf[None], bare[None], masks)
            captured = (captures(psf, self.scenes) - self.scenes).square().mean()
            bench = self.recipe.bench
            ratio = strehl(height_um, INDEX, WAVE_UM, bench=bench, depth_mm=bench.focus_mm)
            return {
                "core_share": round(found.core_share[0], 4),
                "streak_share": round(found.streak_share[0], 4),
                "far_share": round(found.far_share[0], 4),
                "strehl": round(ratio, 4),
                "linear_db": round(_db(float(linear_error(psf, self.lamps))), 2),
                "capture_db": round(_db(float(captured)), 2),
                "blind_loss": round(float(blind_loss(psf, self.scenes)), 6),
            }

    def moved(self, made: HeightMap, read: Reader, *, steps: int, rate: float) -> Tensor:
        """Return the heights after steps of Adam under a reader."""
        optimizer = torch.optim.Adam(made.parameters(), lr=rate)
        for step in range(steps):
            for group in optimizer.param_groups:
                group["lr"] = rate * (1 - step / steps)
            optimizer.zero_grad(set_to_none=True)
            loss = read(self.psf(made()))
            loss.backward()  # type: ignore[no-untyped-call]
            optimizer.step()
        height_um: Tensor = made()
        return height_um.detach()


def _db(error: float) -> float:
    return 10 * math.log10(PEAK**2 / error)


def measure(cells: int, steps: int, seed: int) -> dict[str, Any]:
    """Run everything; give the rows by name."""
    begin = time.process_time()
    recipe = small_recipe(cells, steps, seed)
    trial = Trial(
        recipe=recipe,
        lamps=tuple(lamp_of(radius) for radius in RADII_PX),
        scenes=scenes_of(4, seed),
    )
    loop = PlateLoop(recipe, begin_map(recipe))
    for _ in loop.run():
        pass
    loop.take_best()
    with torch.no_grad():
        designed = loop.made().detach()
        random = begin_map(recipe)().detach()
    readers: dict[str, Reader] = {
        "blind": lambda psf: blind_loss(psf, trial.scenes),
        "linear": lambda psf: linear_error(psf, trial.lamps).log(),
    }
    rows = {
        "bare lens": trial.row(torch.zeros_like(designed)),
        "rank 3, random": trial.row(random),
        "rank 3, eq. 5.12": trial.row(designed),
    }
    for name, read in readers.items():
        full = trial.moved(FullMap(designed), read, steps=steps, rate=0.002)
        rows[f"every cell from there, {name}"] = trial.row(full)
        rank = trial.moved(begin_map(recipe).float(), read, steps=steps, rate=0.05)
        rows[f"rank 3 from random, {name}"] = trial.row(rank)
    return {
        "cells": cells,
        "steps": steps,
        "seed": seed,
        "wavelength_um": WAVE_UM,
        "cpu_s": round(time.process_time() - begin, 1),
        "rows": rows,
    }


def main(arguments: list[str]) -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out-dir", type=Path, required=True)
    parser.add_argument("--cells", type=int, default=382)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args(arguments)
    found = measure(chosen.cells, chosen.steps, chosen.seed)
    chosen.out_dir.mkdir(parents=True, exist_ok=True)
    out = chosen.out_dir / "collapse.json"
    out.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    for name, row in found["rows"].items():
        print(f"{name:36}", *(f"{key} {value:g}" for key, value in row.items()))
    print(out)


if __name__ == "__main__":
    main(sys.argv[1:])
