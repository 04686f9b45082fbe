"""Rays through a lens by another tracer, timed on request; it imports nothing of camkit.

    PYTHON tools/comparison/tracer_worker.py PROGRAM JOB.npz

PROGRAM is optiland-numpy, optiland-torch or deeplens (its folder in PYTHONPATH). The job holds the
lens and the rays (see `tracer_speed`). For every line `forward` or `both` on standard input it
prints a line of JSON: the CPU seconds of one run (`both` has the gradient of the mean square spot
radius by every curvature), or the error. `end` prints how many rays arrive and where.
"""

import json
import sys
import time
import types
import warnings
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

COLUMNS = ("curvature", "conic", "even", "gap")
Run = Callable[[], Any]


def optiland_runs(job: Any, backend: str) -> tuple[Run, Run]:
    """Return forward (landing x and y), and forward with backward."""
    import optiland.backend as be
    from optiland.materials import IdealMaterial
    from optiland.optic import Optic
    from optiland.rays import RealRays

    be.set_backend(backend)
    if backend == "torch":
        be.set_precision(str(job["precision"]))
        be.grad_mode.enable()
    lens: Any = Optic()
    lens.surfaces.add(index=0, thickness=be.inf)
    rows = zip(*(job[name] for name in COLUMNS), job["index"][1:], strict=True)
    for i, (curvature, conic, even, gap, index) in enumerate(rows, start=1):
        aspheric = bool(np.any(even)) or conic != 0
        shape = {"surface_type": "even_asphere", "conic": conic, "coefficients": list(even)}
        lens.surfaces.add(
            index=i,
            radius=1 / curvature if curvature else be.inf,
            thickness=gap,
            material=IdealMaterial(n=float(index)),
            is_stop=i == 1,
            **(shape if aspheric else {}),
        )
    lens.surfaces.add(index=len(job["curvature"]) + 1)
    ones = np.ones(len(job["x"]))
    columns = [job[name] for name in "xyzlmn"] + [ones, 0.55 * ones]

    def landings() -> Any:
        rays = RealRays(*(be.array(np.asarray(v, dtype=np.float64)) for v in columns))
        return lens.surfaces.trace(rays) or rays

    def forward() -> Any:
        if backend == "numpy":
            end = landings()
            return end.x, end.y
        import torch

        with torch.no_grad():
            end = landings()
        return end.x.numpy(), end.y.numpy()

    def both() -> Any:
        if backend == "numpy":
            raise NotImplementedError("no gradient")
        import torch

        dtype = getattr(torch, str(job["precision"]))
        bends = [torch.tensor(float(c), dtype=dtype).requires_grad_() for c in job["curvature"]]
        for i, bend in enumerate(bends, start=1):
            if float(bend) != 0:
                lens.surfaces[i].geometry.radius = 1 / bend
        end = landings()
        spread(end.x, end.y).backward()
        return bends

    return forward, both


def deeplens_runs(job: Any) -> tuple[Run, Run]:
    """Return the same of DeepLens: its surfaces and rays, in the loop of its `GeoLens`.

    Its packages are opened without what their first files import: networks and data sets.
    """
    import torch

    torch.set_num_threads(1)
    torch.set_default_dtype(getattr(torch, str(job["precision"])))
    root = next(p for p in map(Path, sys.path) if (p / "deeplens" / "optics").is_dir())
    for name in ("deeplens", "deeplens.optics", "deeplens.optics.geometric_surface"):
        package = types.ModuleType(name)
        package.__path__ = [str(root.joinpath(*name.split(".")))]
        sys.modules[name] = package
    shapes = "deeplens.optics.geometric_surface"
    aspheric_type: Any = import_module(f"{shapes}.aspheric").Aspheric
    spheric_type: Any = import_module(f"{shapes}.spheric").Spheric
    ray_type: Any = import_module("deeplens.optics.ray").Ray
    surfaces: list[Any] = []
    depth_mm = 0.0
    rows = zip(*(job[name] for name in COLUMNS), job["reach"], strict=True)
    for curvature, conic, even, gap, reach in rows:
        place = {"r": float(reach), "d": depth_mm, "mat2": "air", "c": float(curvature)}
        if np.any(even) or conic != 0:
            surfaces.append(aspheric_type(**place, k=float(conic), ai=[float(a) for a in even]))
        else:
            surfaces.append(spheric_type(**place))
        depth_mm += float(gap)
    indices = [torch.tensor(float(n)) for n in job["index"]]
    begin = torch.tensor(np.stack([job[n] for n in "xyz"], -1), dtype=torch.get_default_dtype())
    way = torch.tensor(np.stack([job[n] for n in "lmn"], -1), dtype=torch.get_default_dtype())

    def landings() -> Any:
        ray = ray_type(begin.clone(), way.clone(), 0.55)
        for surface, before, after in zip(surfaces, indices[:-1], indices[1:], strict=True):
            ray = surface.ray_reaction(ray, before, after)
        return ray.prop_to(depth_mm)

    def forward() -> Any:
        with torch.no_grad():
            end = landings()
        x, y = (torch.where(end.is_valid > 0, end.o[..., i], torch.nan) for i in (0, 1))
        return x.numpy(), y.numpy()

    def both() -> Any:
        for surface, curvature in zip(surfaces, job["curvature"], strict=True):
            surface.c = torch.tensor(float(curvature)).requires_grad_()
        end = landings()
        spread(end.o[..., 0], end.o[..., 1]).backward()
        return [surface.c for surface in surfaces]

    return forward, both


def spread(x: Any, y: Any) -> Any:
    """Return the mean square distance from the centroid."""
    return ((x - x.mean()) ** 2 + (y - y.mean()) ** 2).mean()


def answer(line: str, forward: Run, both: Run) -> dict[str, Any]:
    """Return the answer to one line of standard input."""
    if line == "end":
        x, y = (np.asarray(v, dtype=np.float64) for v in forward())
        return {"rays": int(np.isfinite(x).sum()), "x": x.tolist(), "y": y.tolist()}
    run = forward if line == "forward" else both
    start = time.process_time()
    run()
    return {"seconds": time.process_time() - start}


def main() -> None:
    """Print an answer to every line of standard input."""
    warnings.filterwarnings("ignore")
    program, job = sys.argv[1], np.load(sys.argv[2])
    try:
        name, _, backend = program.partition("-")
        forward, both = deeplens_runs(job) if name == "deeplens" else optiland_runs(job, backend)
        print(json.dumps({"ready": program}), flush=True)
    except Exception as error:  # noqa: BLE001 -- another program's errors are its own
        print(json.dumps({"error": f"{type(error).__name__}: {error}"[:200]}), flush=True)
        return
    for line in sys.stdin:
        try:
            result = answer(line.strip(), forward, both)
        except Exception as error:  # noqa: BLE001 -- another program's errors are its own
            result = {"error": f"{type(error).__name__}: {error}"[:200]}
        print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main()
