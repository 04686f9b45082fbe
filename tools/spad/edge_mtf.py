"""Figure 4.9: MTF of the array, and of the picture made of it without and with the plate.

    python -m tools.spad.edge_mtf --low-fill CKPT --learned CKPT --out-dir out/spad

Slanted edges, upright and level, of two angles and both ways round, are seen by an array without
a plate (`low_fill`) and through the learned one, with and without noise. Each picture is made by
bicubic interpolation, by the best linear filter (fitted to procedural scenes at the same level of
light), and by the networks of the checkpoints; pictures of several draws of the noise are averaged.
Frequencies are cycles per pixel of the fine grid; `array` is the MTF of the samples themselves,
whose own Nyquist limit is 0.125. Writes `edge-mtf.json` and `edge-mtf.png`, prints a table.

References: Sun 2021, figure 4.9.
"""

import argparse
import json
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.errors import CamkitError, ContractError
from camkit.models_def.kinds.spad.counting import Exposure
from camkit.models_def.kinds.spad.evaluation import bicubic
from camkit.models_def.kinds.spad.linear import fit_linear
from camkit.models_def.kinds.spad.plate_psf import read_plate_psf
from camkit.models_def.kinds.spad.recipe import SpadRecipe
from camkit.models_def.kinds.spad.samples import draw_luminance, photograph
from camkit.models_def.kinds.spad.sampling import Sampling, make_sampling
from camkit.models_def.networks.bicubic import SCALE
from camkit.models_def.training.checkpoint import load_network, read_checkpoint, recipe_of
from camkit.models_def.training.kind import Restorer
from camkit.models_def.training.pictures import open_source
from camkit.report.edge_mtf import edge_mtf
from camkit.report.figure import field_color, new_figure, to_png
from camkit.scenes.slanted_edge import LEVELS, slanted_edge

Curve = NDArray[np.float64]

PLATE: Final = Path(str(resources.files("camkit.models_def.plates"))) / "spad-sr.safetensors"
SAMPLINGS: Final = ("low_fill", "learned")
ARRAY: Final = "array"
NETWORK: Final = "network"
IDEAL: Final = "ideal"
SIDE_PX: Final = 640
"""Of the fine picture: more than the camera's, so that an edge shows many positions."""
CUT_PX: Final = 64
SLOPES: Final = (0.074, 0.146)
"""Of these the rows of a small array show many positions within a pixel."""
CYCLES_PER_PX: Final[Curve] = np.linspace(0, 1, 81)
ARRAY_BINS: Final = 12
ARRAY_NYQUIST: Final = 1 / (2 * SCALE)
FINE_NYQUIST: Final = 0.5
MOST: Final = 1.05
PHOTONS: Final = (math.inf, 1e4)
DRAWS: Final = 4
FIT_CROPS: Final = 60
FIT_PX: Final = 256
FIT_SEED: Final = 17
ROUNDING: Final = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Edge:
    """An edge on the fine grid.

    Attributes:
        slope: Of the edge against its axis.
        along_columns: Whether that is y.
        levels: Left (or above) and right (or below).
    """

    slope: float
    along_columns: bool
    levels: tuple[float, float]

    def drawn(self, side_px: int) -> Tensor:
        """Return the picture (1, 1, side, side)."""
        scene = slanted_edge(
            side_px,
            side_px,
            angle_rad=math.atan(self.slope),
            along_columns=self.along_columns,
            levels=self.levels,
        )
        return torch.from_numpy(scene[None, :1].copy())


EDGES: Final = tuple(
    Edge(slope=slope, along_columns=upright, levels=levels)
    for slope in SLOPES
    for upright in (True, False)
    for levels in (LEVELS, (LEVELS[1], LEVELS[0]))
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """The MTF of one method.

    Attributes:
        sampling: `low_fill`, `learned`, or `ideal` for the fine picture itself.
        method: `array` for the samples, else what made the picture.
        photons: Of white; inf for no noise.
        curves: (edge, frequency).
    """

    sampling: str
    method: str
    photons: float
    curves: Curve

    @property
    def mean(self) -> Curve:
        """Return the mean over the edges."""
        return np.asarray(self.curves.mean(0))

    def at(self, cycles_per_px: float) -> float:
        """Return the mean at a frequency."""
        return float(np.interp(cycles_per_px, CYCLES_PER_PX, self.mean))

    def largest(self, *, mean: bool) -> float:
        """Return the largest value at any frequency, of the mean or of any edge."""
        return float((self.mean if mean else self.curves).max())

    @property
    def tenth(self) -> float:
        """Return the first frequency at which the mean is 0.1; the last one where there is none."""
        below = np.flatnonzero(self.mean < 0.1)
        if not below.size:
            return float(CYCLES_PER_PX[-1])
        last = slice(int(below[0]) - 1, int(below[0]) + 1)
        return float(np.interp(-0.1, -self.mean[last], CYCLES_PER_PX[last]))

    def line(self) -> str:
        """Return the row of the table."""
        level = "no noise" if math.isinf(self.photons) else f"{self.photons:g}"
        numbers = (self.at(ARRAY_NYQUIST), self.at(0.25), self.at(FINE_NYQUIST))
        told = " | ".join(f"{number:.3f}" for number in numbers)
        return (
            f"| {level} | {self.sampling} | {self.method} | {told} | {self.tenth:.2f} "
            f"| {self.largest(mean=True):.3f} | {self.largest(mean=False):.3f} |"
        )

    def entry(self) -> dict[str, Any]:
        """Return plain JSON values; no noise is null."""
        return {
            "sampling": self.sampling,
            "method": self.method,
            "photons": None if math.isinf(self.photons) else self.photons,
            "mtf_array_nyquist": round(self.at(ARRAY_NYQUIST), ROUNDING),
            "mtf_025": round(self.at(0.25), ROUNDING),
            "mtf_050": round(self.at(FINE_NYQUIST), ROUNDING),
            "tenth_cycles_per_px": round(self.tenth, ROUNDING),
            "largest": round(self.largest(mean=True), ROUNDING),
            "largest_of_edges": round(self.largest(mean=False), ROUNDING),
            "mtf": np.round(self.mean, ROUNDING).tolist(),
        }


def main(words: Sequence[str] | None = None) -> None:
    """Measure, write, draw and print.

    Raises:
        SystemExit: If a checkpoint or the plate does not fit; says which.
    """
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--low-fill", type=Path, help="checkpoint of a network without a plate")
    parser.add_argument("--learned", type=Path, help="checkpoint of a network behind the plate")
    parser.add_argument("--psf", type=Path, default=PLATE, help="of the plate; default: shipped")
    parser.add_argument("--photons", type=float, nargs="+", default=PHOTONS, help="inf: no noise")
    parser.add_argument("--draws", type=int, default=DRAWS, help="of the noise, averaged")
    parser.add_argument("--out-dir", type=Path, default=Path("out/spad"))
    options = parser.parse_args(words)
    try:
        rows = measure(options)
    except CamkitError as error:
        raise SystemExit(f"error: {error}") from error
    options.out_dir.mkdir(parents=True, exist_ok=True)
    write(rows, options, options.out_dir / "edge-mtf.json")
    (options.out_dir / "edge-mtf.png").write_bytes(chart(rows))


def measure(options: argparse.Namespace) -> list[Row]:
    """Return the rows of all methods, each printed as soon as it is known."""
    plate = read_plate_psf(options.psf)
    samplings = [
        make_sampling(mode, kernel=plate if mode == "learned" else None) for mode in SAMPLINGS
    ]
    checkpoints = {"low_fill": options.low_fill, "learned": options.learned}
    networks = {m: read_network(path, m) for m, path in checkpoints.items() if path is not None}
    rows: list[Row] = []
    print(
        "| photons | sampling | method | at 0.125 | at 0.25 | at 0.5 | 10 % at | up to "
        "| of any edge |"
    )
    print("|---|---|---|---|---|---|---|---|---|")

    def keep(row: Row) -> None:
        rows.append(row)
        print(row.line(), flush=True)

    keep(_row(IDEAL, IDEAL, math.inf, lambda edge: _mtf(edge.drawn(SIDE_PX)), EDGES))
    for photons in options.photons:
        draws = 1 if math.isinf(photons) else options.draws
        exposure = Exposure(photons=photons)
        for sampling in samplings:
            seen = [_seen(edge, sampling, exposure, draws) for edge in EDGES]
            mode = sampling.mode
            keep(_row(mode, ARRAY, photons, _array_mtf, seen))
            methods: dict[str, Restorer] = {
                "bicubic": bicubic(sampling),
                "linear": fit_linear(_pairs(sampling, exposure)),
            }
            if mode in networks:
                methods[NETWORK] = networks[mode]
            for name, restore in methods.items():
                keep(_row(mode, name, photons, _restored_mtf(restore), seen))
    return rows


def read_network(path: Path, mode: str) -> Restorer:
    """Read the network of a checkpoint.

    Args:
        path: Of the checkpoint.
        mode: The sampling that it must have been trained behind.

    Raises:
        ContractError: If it is no checkpoint of such a camera.
    """
    checkpoint = read_checkpoint(path)
    recipe = recipe_of(checkpoint)
    if not isinstance(recipe, SpadRecipe) or recipe.sampling.mode != mode:
        of = getattr(getattr(recipe, "sampling", None), "mode", recipe.kind)
        raise ContractError(f"{path} must be a network behind {mode}; it is one behind {of}")
    network = load_network(checkpoint)
    planes = 2 if recipe.data.told else 1

    def restore(light: Tensor) -> Tensor:
        with torch.inference_mode():
            return torch.cat([network(one[None, :planes]) for one in light])

    return restore


def _pairs(sampling: Sampling, exposure: Exposure) -> Iterable[tuple[Tensor, Tensor]]:
    """Return light and pictures of procedural scenes, to fit to."""
    source = open_source(None, picture_share=0, scenes=FIT_CROPS // 2, scene_px=2 * FIT_PX)
    rng = np.random.default_rng(FIT_SEED)
    for _ in range(FIT_CROPS):
        fine = draw_luminance(source, rng, FIT_PX)
        yield photograph(fine, sampling, exposure, rng)[:, :1], fine


def _seen(edge: Edge, sampling: Sampling, exposure: Exposure, draws: int) -> Tensor:
    """Return light and noise (draw, 2, h, w)."""
    fine = edge.drawn(SIDE_PX)
    seeds = range(draws)
    return torch.cat(
        [photograph(fine, sampling, exposure, np.random.default_rng(seed)) for seed in seeds]
    )


def _row(
    sampling: str,
    method: str,
    photons: float,
    mtf: Callable[[Any], Curve],
    seen: Sequence[Any],
) -> Row:
    curves = np.stack([mtf(one) for one in seen])
    return Row(sampling=sampling, method=method, photons=photons, curves=curves)


def _mtf(pictures: Tensor) -> Curve:
    """Measure the mean of pictures (draw, 1, h, w) on the fine grid."""
    return edge_mtf(_inner(pictures, CUT_PX), cycles_per_px=CYCLES_PER_PX).mtf


def _restored_mtf(restore: Restorer) -> Callable[[Tensor], Curve]:
    return lambda planes: _mtf(restore(planes))


def _array_mtf(planes: Tensor) -> Curve:
    """Measure the mean of light (draw, 2, h, w) of the array, at frequencies of the fine grid."""
    light = _inner(planes, CUT_PX // SCALE)
    return edge_mtf(light, cycles_per_px=SCALE * CYCLES_PER_PX, bins_per_px=ARRAY_BINS).mtf


def _inner(planes: Tensor, cut_px: int) -> Curve:
    mean = planes[:, 0].double().mean(0).numpy()
    return np.asarray(mean[cut_px:-cut_px, cut_px:-cut_px])


def write(rows: Sequence[Row], options: argparse.Namespace, path: Path) -> None:
    """Write all rows as JSON."""
    content = {
        "cycles_per_px": CYCLES_PER_PX.round(ROUNDING).tolist(),
        "edges": len(EDGES),
        "levels": LEVELS,
        "draws": options.draws,
        "plate": options.psf.name,
        "rows": [row.entry() for row in rows],
    }
    path.write_text(json.dumps(content) + "\n", encoding="utf-8")


def chart(rows: Sequence[Row]) -> bytes:
    """Draw a panel for every level of light; dotted is without plate, full with it."""
    levels = list(dict.fromkeys(row.photons for row in rows))
    figure = new_figure(5.2 * len(levels), 4.2)
    panels = figure.subplots(1, len(levels), sharey=True, squeeze=False)[0]
    methods = list(dict.fromkeys(row.method for row in rows))
    for photons, panel in zip(levels, panels, strict=True):
        for row in rows:
            if row.photons == photons or row.method == IDEAL:
                panel.plot(
                    CYCLES_PER_PX,
                    row.mean,
                    color="k" if row.method == IDEAL else field_color(methods.index(row.method)),
                    linestyle=":" if row.sampling == "low_fill" else "-",
                    label=row.method if row.method == IDEAL else f"{row.sampling}, {row.method}",
                )
        panel.axhline(MOST, color="0.7", linewidth=0.8)
        for limit in (ARRAY_NYQUIST, FINE_NYQUIST):
            panel.axvline(limit, color="0.7", linewidth=0.8)
        panel.set_title("no noise" if math.isinf(photons) else f"{photons:g} photons of white")
        panel.set_xlabel("cycles per pixel of the fine grid")
        panel.set_ylim(0, None)
    panels[0].set_ylabel("MTF")
    panels[-1].legend(fontsize=7)
    return to_png(figure)


if __name__ == "__main__":
    main()
