"""The constants of depth on the fine grid, from scenes of their own.

    python -m tools.spad.depth_sigma --bundle spad-sr -o docs/results/spad/depth-constants.json

`sharper`: mean error of the linear estimate, in mm, over how many times its light a bin has for it.
`linear`, `network`: the shares of sigma (`SigmaShares`) for which the 68 % quantile of |error| /
sigma is nearest to 1 where it is furthest from it, over all levels of light (of the network: those
at which depth is read behind it, of every size); with these quantiles. `tools.spad.depth` judges
the constants on other scenes.
"""

import argparse
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from camkit.bundle.reader import find_bundle, open_bundle
from camkit.runtime.kinds.spad.finer.bins import SHARPER
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.runtime.kinds.spad.finer.depth import FineSharpener
from camkit.runtime.kinds.spad.finer.sigma import OF_LINEAR, OF_NETWORK, SigmaShares, slopes
from camkit.runtime.kinds.spad.sharpen import Way
from camkit.runtime.kinds.spad.timing import LIGHT_M_PER_PS
from camkit.runtime.kinds.spad.twin.simulate import times_of
from tools.comparison.compact_json import to_compact_json
from tools.spad.depth import MM, record

LIGHTS: Final = (
    (30.0, 3.0),
    (60.0, 1.0),
    (100.0, 3.0),
    (300.0, 1.0),
    (300.0, 10.0),
    (1000.0, 3.0),
    (3000.0, 3.0),
    (10_000.0, 10.0),
)
"""Signal photons of a pixel, on average, and their ratio to those of the background."""
SHARPERS: Final = (1.0, 3.0, 10.0, 20.0, 40.0, 100.0)
SHARPER_LIGHTS: Final = LIGHTS[::2]
FIRST_SEED: Final = 60
RAW: Final = SigmaShares()
SAMPLE: Final = 8192
"""Sub-pixels of a scene that are fitted to."""
STARTS: Final = (0.5, 0.8, 1.0, 1.5)
"""Times the constants that are taken."""
DIGITS: Final = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """What one way made of one level of light.

    Attributes:
        photons: Signal photons of a pixel, as they were found.
        errors_ps: (n,) of times that are believed, absolute.
        linear_ps: (n,) sigma of the linear estimate.
        slopes_ps: (n,) of the times.
        bin_ps: Width of a bin.
    """

    photons: float
    errors_ps: NDArray[np.float64]
    linear_ps: NDArray[np.float64]
    slopes_ps: NDArray[np.float64]
    bin_ps: float

    def quantile(self, shares: SigmaShares) -> float:
        """Return the 68 % quantile of |error| / sigma."""
        sigma = shares.sigma_ps(
            self.linear_ps, self.slopes_ps, photons=self.photons, bin_ps=self.bin_ps
        )
        return float(np.quantile(self.errors_ps / sigma, 0.6827))


def main(words: Sequence[str] | None = None) -> None:
    """Measure, fit, and write JSON."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bundle", default="spad-sr", help="NAME or PATH")
    parser.add_argument("--scenes", type=int, default=12)
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args(words)
    camera = FineCamera.of(open_bundle(find_bundle(arguments.bundle)))
    found = constants(camera, arguments.scenes)
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    arguments.output.write_text(to_compact_json(found, DIGITS) + "\n", encoding="utf-8")
    print(json.dumps(found, indent=1))


def constants(camera: FineCamera, scenes: int) -> dict[str, Any]:
    """Return all constants, with what they were chosen by."""
    least, lights = camera.stage.network_from_photons, LIGHTS
    sizes = tuple(camera.sizes)
    linear = {light: _errors(camera, *light, None, scenes) for light in lights}
    network = {
        (*light, size): _errors(camera, *light, size, scenes)
        for light in lights
        for size in sizes
        if light[0] >= least
    }
    return {
        "scenes": scenes,
        "sharper": {
            "taken": SHARPER,
            "mean_error_mm": [
                {
                    "photons": photons,
                    "sbr": sbr,
                    **{
                        f"{sharper:g}": _mean_mm(camera, photons, sbr, sharper, scenes)
                        for sharper in SHARPERS
                    },
                }
                for photons, sbr in lights
                if (photons, sbr) in SHARPER_LIGHTS
            ],
        },
        "linear": _fitted(linear, OF_LINEAR, ("slope",)),
        "network": _fitted(network, OF_NETWORK, ("noise", "faint", "slope", "of_bin")),
    }


def _errors(
    camera: FineCamera, photons: float, sbr: float, size: str | None, scenes: int
) -> Errors:
    axis, pulse = times_of(camera)
    fine = FineSharpener(camera, axis, pulse, Way(), size=size, always=size is not None)
    fine.shares = (RAW, RAW)
    parts = []
    levels = []
    for seed in range(FIRST_SEED, FIRST_SEED + scenes):
        depth, counts = record(camera, seed, photons, sbr)
        made = _made(camera, fine, counts)
        times = made.found.time_of_flight_ps
        errors = np.abs(times[0] - 2 * depth / LIGHT_M_PER_PS)
        rows = np.stack([errors, made.found.sigma_ps[0], slopes(times)[0]])
        rows = rows[:, made.found.valid[0]]
        chosen = np.random.default_rng(seed).permutation(rows.shape[1])[:SAMPLE]
        parts.append(rows[:, chosen])
        levels.append(made.photons)
    errors_ps, linear_ps, slopes_ps = np.concatenate(parts, axis=1)
    return Errors(
        photons=float(np.mean(levels)),
        errors_ps=errors_ps,
        linear_ps=linear_ps,
        slopes_ps=slopes_ps,
        bin_ps=axis.step_ps,
    )


def _made(camera: FineCamera, fine: FineSharpener, counts: NDArray[np.float32]) -> Any:
    shape = (camera.sensor.height_px, camera.sensor.width_px)
    nothing = np.zeros(shape, dtype=bool)
    return fine.cube(counts, np.zeros(shape), hot=nothing, blind=nothing)


def _mean_mm(camera: FineCamera, photons: float, sbr: float, sharper: float, scenes: int) -> float:
    axis, pulse = times_of(camera)
    fine = FineSharpener(camera, axis, pulse, Way())
    fine.sharper = sharper
    means = []
    for seed in range(FIRST_SEED, FIRST_SEED + scenes):
        depth, counts = record(camera, seed, photons, sbr)
        times = _made(camera, fine, counts).found.time_of_flight_ps[0]
        means.append(np.abs(times * LIGHT_M_PER_PS / 2 - depth).mean() * MM)
    return float(np.mean(means))


def _fitted(errors: dict[Any, Errors], start: SigmaShares, names: Iterable[str]) -> dict[str, Any]:
    """Return the shares of least largest departure from 1, beside those taken."""
    names = tuple(names)

    def shares(values: NDArray[np.float64]) -> SigmaShares:
        return replace(start, **dict(zip(names, np.abs(values).tolist(), strict=True)))

    def worst(values: NDArray[np.float64]) -> float:
        return max(abs(float(np.log(one.quantile(shares(values))))) for one in errors.values())

    first = np.array([getattr(start, name) for name in names])
    tries = [
        minimize(worst, first * factor, method="Nelder-Mead", options={"fatol": 1e-4})
        for factor in STARTS
    ]
    best = min(tries, key=lambda found: float(found.fun))
    return {
        "best": asdict(shares(best.x)),
        "taken": asdict(start),
        "quantiles": [
            {
                "light": list(light),
                "best": one.quantile(shares(best.x)),
                "taken": one.quantile(start),
            }
            for light, one in errors.items()
        ],
    }


if __name__ == "__main__":
    main()
