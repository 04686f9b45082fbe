"""Time the tracer beside optiland and DeepLens: the same lens, rays and precision, one thread.

    python -m tools.comparison.tracer_speed LENS [LENS ...] [--optiland PYTHON]
        [--deeplens FOLDER] [--rays N] [--rounds N] [--precisions float32 float64]
        [--plain] [--json OUT]

For every lens (any file that camkit reads) the beam of its middle field is traced to the sensor,
forward, and forward with the gradient of the mean square spot radius by every curvature. Rounds
are interleaved: each program once, then again. A row has M ray-surfaces per CPU-second (medians)
and how far the program's rays land from camkit's in double precision. `--optiland` is the
interpreter of an environment that has optiland (and, for its torch backend, torch); it also runs
DeepLens, whose repository's folder is given with `--deeplens`. Other programs see no rims, except
DeepLens, which has some beyond the beam.
"""

import argparse
import json
import os
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch

from camkit.models_def.optics.aiming.start import with_open_apertures
from camkit.models_def.optics.lens_file.lens_file import read_noted_lens
from camkit.models_def.optics.pupil import half_disc, pupil_rays
from camkit.models_def.optics.trace import Rays, SurfaceTensors, surface_tensors, trace

WORKER: Final = Path(__file__).with_name("tracer_worker.py")
PRECISIONS: Final = ("float32", "float64")
_REACH: Final = 1.2
_COLUMNS: Final = "xyzlmn"

Answer = Callable[[str], dict[str, Any]]


def beam(path: Path, rays: int) -> tuple[SurfaceTensors, Rays]:
    """Return a lens, its rims open, and the rays of its middle field, float64.

    Raises:
        CamkitError: If the file is refused or the field cannot be aimed.
    """
    lens, _ = read_noted_lens(path)
    wave = torch.tensor(lens.reference_wavelength_um, dtype=torch.float64)
    tensors = with_open_apertures(surface_tensors(lens, wave))
    angle = torch.tensor([lens.field_angles_rad[len(lens.field_angles_rad) // 2]])
    with torch.no_grad():
        start, _ = pupil_rays(lens, tensors, half_disc(rays), torch.tan(angle.double()))
        alive = trace(tensors, start).valid
    columns = {name: getattr(start, name)[alive] for name in (*_COLUMNS, "fate")}
    return tensors, Rays(**columns)


def in_precision(
    tensors: SurfaceTensors, rays: Rays, dtype: torch.dtype
) -> tuple[SurfaceTensors, Rays]:
    """Return a lens and its rays as numbers of a type."""
    cast = {name: getattr(rays, name).to(dtype) for name in _COLUMNS}
    return tensors.converted(dtype), replace(rays, **cast)


def write_job(path: Path, tensors: SurfaceTensors, rays: Rays, precision: str) -> None:
    """Write a lens and its rays for the workers."""
    met: list[Rays] = []
    with torch.no_grad():
        trace(tensors, rays, surface_rays=met)
    reach = [_REACH * float(torch.hypot(r.x, r.y).max()) for r in met]
    np.savez(
        path,
        curvature=tensors.curvature_per_mm.numpy(),
        conic=tensors.conic.numpy(),
        even=tensors.even_asphere.numpy(),
        gap=tensors.thickness_mm.numpy(),
        index=tensors.index.numpy(),
        reach=np.array(reach),
        precision=np.array(precision),
        **{name: getattr(rays, name).numpy() for name in _COLUMNS},
    )


def camkit_answer(tensors: SurfaceTensors, rays: Rays, *, compiled: bool) -> Answer:
    """Return what answers as the workers do; `end` is never compiled."""
    free = tensors.curvature_per_mm.clone().requires_grad_()

    def answer(line: str) -> dict[str, Any]:
        start = time.process_time()
        if line == "both":
            free.grad = None
            end = trace(replace(tensors, curvature_per_mm=free), rays, compiled=compiled)
            dx, dy = end.x - end.x.mean(), end.y - end.y.mean()
            (dx**2 + dy**2).mean().backward()  # type: ignore[no-untyped-call]
        else:
            with torch.no_grad():
                end = trace(tensors, rays, compiled=compiled)
        seconds = time.process_time() - start
        if line == "end":
            return {"rays": int(end.valid.sum()), "x": end.x.tolist(), "y": end.y.tolist()}
        return {"seconds": seconds}

    return answer


class Worker:
    """Another program in a process of its own."""

    def __init__(self, python: Path, program: str, job: Path, folder: Path | None) -> None:
        """Start it; `fault` says why it cannot."""
        paths = {} if folder is None else {"PYTHONPATH": str(folder.resolve())}
        self._process = subprocess.Popen(
            [str(python), str(WORKER), program, str(job)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env={**os.environ, "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1", **paths},
            cwd=Path.home(),
        )
        self.fault: str | None = self._line().get("error")

    def _line(self) -> dict[str, Any]:
        """Return the next answer, past what the program itself prints."""
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.startswith("{"):
                return dict(json.loads(line))
        return {"error": "it ended"}

    def __call__(self, line: str) -> dict[str, Any]:
        """Return the answer to a line."""
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()
        return self._line()

    def stop(self) -> None:
        """End the process."""
        self._process.communicate()


def interleaved(answers: dict[str, Answer], line: str, rounds: int) -> dict[str, float]:
    """Return the median CPU seconds of each program; NaN of one that fails. One round warms up."""
    seconds: dict[str, list[float]] = {name: [] for name in answers}
    for turn in range(rounds + 1):
        for name, answer in answers.items():
            result = answer(line)
            if turn:
                seconds[name].append(result.get("seconds", float("nan")))
    return {name: statistics.median(values) for name, values in seconds.items()}


def off_um(end: dict[str, Any], true: dict[str, Any]) -> float:
    """Return the largest distance in um between landings; rays that are lost do not count."""
    gaps = [np.array(end[axis]) - np.array(true[axis]) for axis in "xy"]
    return 1000 * float(np.nanmax(np.hypot(*gaps)))


def compare(path: Path, precision: str, arguments: argparse.Namespace) -> list[dict[str, Any]]:
    """Return a row for every program that runs a lens."""
    tensors, rays = beam(path, arguments.rays)
    truth = camkit_answer(tensors, rays, compiled=False)("end")
    narrow = in_precision(tensors, rays, getattr(torch, precision))
    answers: dict[str, Answer] = {"camkit": camkit_answer(*narrow, compiled=False)}
    if not arguments.plain:
        answers["camkit, compiled"] = camkit_answer(*narrow, compiled=True)
    workers: list[Worker] = []
    with tempfile.TemporaryDirectory() as folder:
        job = Path(folder) / "job.npz"
        write_job(job, tensors, rays, precision)
        for name, program, extra in _programs(arguments, precision):
            worker = Worker(arguments.optiland, program, job, extra)
            workers.append(worker)
            if worker.fault is None:
                answers[name] = worker
            else:
                print(f"{name}: {worker.fault}")
        forward = interleaved(answers, "forward", arguments.rounds)
        both = interleaved(answers, "both", arguments.rounds)
        ends = {name: answer("end") for name, answer in answers.items()}
        for worker in workers:
            worker.stop()
    work = len(tensors.aspheric) * len(rays.x) / 1e6
    return [
        {
            "lens": path.stem,
            "surfaces": len(tensors.aspheric),
            "aspheric": sum(tensors.aspheric),
            "rays": len(rays.x),
            "precision": precision,
            "program": name,
            "forward": work / forward[name],
            "both": None if np.isnan(both[name]) else work / both[name],
            "rays_arrived": ends[name]["rays"],
            "off_um": off_um(ends[name], truth),
        }
        for name in answers
    ]


def _programs(arguments: argparse.Namespace, precision: str) -> list[tuple[str, str, Path | None]]:
    """Return name, program and folder of the others that run at a precision."""
    if arguments.optiland is None:
        return []
    rows: list[tuple[str, str, Path | None]] = [("optiland, torch", "optiland-torch", None)]
    if precision == "float64":
        rows.append(("optiland, numpy", "optiland-numpy", None))
    if arguments.deeplens is not None:
        rows.append(("DeepLens", "deeplens", arguments.deeplens))
    return rows


def row_text(row: dict[str, Any]) -> str:
    """Return a row of the table."""
    second = "-" if row["both"] is None else f"{row['both']:.1f}"
    return (
        f"| {row['lens']} | {row['precision']} | {row['program']} | {row['forward']:.1f} | "
        f"{second} | {row['off_um']:.2g} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("lenses", type=Path, nargs="+")
    parser.add_argument("--optiland", type=Path, help="interpreter that has optiland")
    parser.add_argument("--deeplens", type=Path, help="folder of DeepLens's repository")
    parser.add_argument("--rays", type=int, default=98_304)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--precisions", nargs="+", choices=PRECISIONS, default=PRECISIONS)
    parser.add_argument("--plain", action="store_true", help="leave the compiled trace out")
    parser.add_argument("--json", type=Path, help="file for all numbers")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    print("| lens | precision | program | forward | forward + backward | off, um |")
    print("|---|---|---|---|---|---|")
    rows: list[dict[str, Any]] = []
    for path in arguments.lenses:
        for precision in arguments.precisions:
            some = compare(path, precision, arguments)
            print("\n".join(map(row_text, some)), flush=True)
            rows += some
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
