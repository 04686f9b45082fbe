"""Measure the tracer, beside other tracers where they are installed, and write table rows.

The Cooke triplet at 14 degrees, a uniform pupil disc, float32, one thread; M ray-surfaces per
CPU-second (six refracting surfaces counted), the median of interleaved rounds. Backward is the
gradient of the mean square spot radius with respect to the six curvatures.

    python -m tools.trace_speed [--rays 98304] [--rounds 7] [--compiled] [--spheres-only]
"""

import argparse
import math
import statistics
import time
from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from typing import Any

import torch

from camkit.models_def.optics.trace import Rays, SurfaceTensors, trace

RADII_MM = (22.01359, -435.76044, -22.21328, 20.29192, 79.68360, -18.39533)
GAPS_MM = (3.25896, 6.00755, 0.99997, 4.75041, 2.95208, 42.20778)
INDICES = (1.0, 1.6226085614386923, 1.0, 1.623655122927604, 1.0, 1.6226085614386923, 1.0)
PUPIL_MM, PUPIL_RADIUS_MM, FIELD_DEG = 11.512158673746793, 5.0, 14.0
CONIC, R4 = -0.1, 1e-7

Run = Callable[[], object]


def cooke(*, aspheric: bool) -> SurfaceTensors:
    """Return the Cooke triplet of the published comparison, float32."""
    terms = [[0.0, R4] if aspheric else []] * 6
    return SurfaceTensors(
        curvature_per_mm=torch.tensor([1 / r for r in RADII_MM]),
        conic=torch.full((6,), CONIC if aspheric else 0.0),
        even_asphere=torch.tensor(terms).reshape(6, -1),
        thickness_mm=torch.tensor(GAPS_MM),
        semi_diameter_mm=torch.full((6,), math.inf),
        index=torch.tensor(INDICES),
        aspheric=(aspheric,) * 6,
    )


def pupil(rays: int) -> tuple[torch.Tensor, torch.Tensor, float]:
    """Return points of the paraxial pupil in the first vertex plane, and the field's slope."""
    number = torch.arange(rays, dtype=torch.float64)
    radius = PUPIL_RADIUS_MM * torch.sqrt((number + 0.5) / rays)
    angle = number * math.pi * (3 - math.sqrt(5))
    slope = math.tan(math.radians(FIELD_DEG))
    x, y = radius * torch.cos(angle), radius * torch.sin(angle) - PUPIL_MM * slope
    return x.float(), y.float(), slope


def camkit_runs(rays: int, *, aspheric: bool, compiled: bool) -> tuple[Run, Run]:
    """Return our forward run and forward with backward."""
    lens = cooke(aspheric=aspheric)
    x, y, slope = pupil(rays)
    n = torch.full_like(x, 1 / math.sqrt(1 + slope**2))
    zero, fate = torch.zeros_like(x), torch.zeros(rays, dtype=torch.int8)
    beam = Rays(x=x, y=y, z=zero, l=zero, m=slope * n, n=n, fate=fate)
    free = lens.curvature_per_mm.clone().requires_grad_()

    def forward() -> object:
        with torch.no_grad():
            return trace(lens, beam, compiled=compiled)

    def both() -> object:
        free.grad = None
        landed = trace(replace(lens, curvature_per_mm=free), beam, compiled=compiled)
        dx, dy = landed.x - landed.x.mean(), landed.y - landed.y.mean()
        (dx**2 + dy**2).mean().backward()  # type: ignore[no-untyped-call]
        return free.grad

    return forward, both


def optiland_runs(rays: int, *, aspheric: bool, backend: str) -> tuple[Run, Run | None]:
    """Return optiland's runs (its numpy backend has no gradient)."""
    import numpy as np
    import optiland.backend as be
    from optiland.materials import IdealMaterial
    from optiland.optic import Optic
    from optiland.rays import RealRays

    def select() -> None:
        be.set_backend(backend)
        if backend == "torch":
            be.set_precision("float32")
            be.grad_mode.enable()

    select()
    lens: Any = Optic()
    lens.surfaces.add(index=0, thickness=be.inf)
    for i, (radius, gap) in enumerate(zip(RADII_MM, GAPS_MM, strict=True), start=1):
        shape = {"surface_type": "even_asphere", "conic": CONIC, "coefficients": [0.0, R4]}
        lens.surfaces.add(
            index=i,
            radius=radius,
            thickness=gap,
            material=IdealMaterial(n=INDICES[i]),
            is_stop=i == 4,
            **(shape if aspheric else {}),
        )
    lens.surfaces.add(index=7)
    x, y, slope = pupil(rays)
    n = 1 / math.sqrt(1 + slope**2)
    columns = [x.numpy(), y.numpy(), np.zeros(rays), np.zeros(rays), np.full(rays, slope * n)]
    columns += [np.full(rays, n), np.ones(rays), np.full(rays, 0.55)]

    def beam() -> Any:
        return RealRays(*(be.array(np.asarray(v, dtype=np.float64)) for v in columns))

    group: Any = lens.surfaces

    def forward() -> object:
        select()
        if backend == "numpy":
            return group.trace(beam())
        with torch.no_grad():
            return group.trace(beam())

    def both() -> object:
        select()
        radii = [torch.tensor(1 / r).requires_grad_() for r in RADII_MM]
        for i, c in enumerate(radii, start=1):
            group[i].geometry.radius = 1 / c
        landed = beam()
        landed = group.trace(landed) or landed
        dx, dy = landed.x - landed.x.mean(), landed.y - landed.y.mean()
        (dx**2 + dy**2).mean().backward()
        return radii

    return forward, (both if backend == "torch" else None)


def contenders(args: argparse.Namespace, *, aspheric: bool) -> dict[str, tuple[Run, Run | None]]:
    """Return what is to be measured."""
    found: dict[str, tuple[Run, Run | None]] = {
        "camkit": camkit_runs(args.rays, aspheric=aspheric, compiled=False)
    }
    if args.compiled:
        found["camkit, compiled"] = camkit_runs(args.rays, aspheric=aspheric, compiled=True)
    if find_spec("optiland"):
        for backend in ("numpy", "torch"):
            name = f"optiland, {backend}"
            found[name] = optiland_runs(args.rays, aspheric=aspheric, backend=backend)
    return found


def measure(runs: dict[str, Run], rounds: int, rays: int) -> dict[str, float]:
    """Return the median speed of each in M ray-surfaces per CPU-second, rounds interleaved."""
    seconds: dict[str, list[float]] = {name: [] for name in runs}
    for turn in range(rounds + 1):
        for name, run in runs.items():
            start = time.process_time()
            run()
            if turn:
                seconds[name].append(time.process_time() - start)
    return {name: 6 * rays / statistics.median(s) / 1e6 for name, s in seconds.items()}


def main() -> None:
    """Print the rows of the table in docs/results/tracer.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rays", type=int, default=98_304)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--compiled", action="store_true")
    parser.add_argument("--spheres-only", action="store_true")
    args = parser.parse_args()
    torch.set_num_threads(1)
    print("| surfaces | code | forward | forward + backward |\n|---|---|---|---|")
    for aspheric in (False,) if args.spheres_only else (False, True):
        found = contenders(args, aspheric=aspheric)
        forward = measure({k: v[0] for k, v in found.items()}, args.rounds, args.rays)
        pairs = {k: v[1] for k, v in found.items() if v[1] is not None}
        both = measure(pairs, args.rounds, args.rays)
        for name, speed in forward.items():
            second = f"{both[name]:.1f}" if name in both else "-"
            kind = "even aspheres" if aspheric else "spheres"
            print(f"| {kind} | {name} | {speed:.1f} | {second} |")


if __name__ == "__main__":
    main()
