"""A plate as designed, as etched by masks that are wrong by a share, and by a scan of shares."""

import math
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from torch import nn

from camkit.contracts import FloatArray
from camkit.models_def.kinds.spad.plate_psf import read_plate_psf, write_plate_psf
from camkit.models_def.kinds.spad.sampling import make_sampling
from camkit.models_def.optics.dots.target import likeness
from camkit.models_def.optics.dots.unit import DotPlate
from camkit.models_def.training.checkpoint import Checkpoint, load_network
from tools.spad.misetch.photograph import measured_psf
from tools.spad.misetch.plate import Etched, etched
from tools.spad.misetch.scores import (
    Method,
    Sets,
    linear_method,
    network_method,
    scored,
    scored_levels,
)
from tools.spad.misetch.tuning import Tuning, ending, tuned

NETWORK: Final = "network"
Row = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trial:
    """What is judged, and by what.

    Attributes:
        sets: Test pictures.
        plate: As designed.
        designed: (11, 11) PSF that it was made for.
        start: File of the network of that PSF.
        checkpoint: What it holds.
        tuning: How it is trained on.
        folder: For photographs and trainings.
    """

    sets: Sets
    plate: DotPlate
    designed: FloatArray
    start: Path
    checkpoint: Checkpoint
    tuning: Tuning
    folder: Path

    def trained_on(self, psf: Path) -> Checkpoint:
        """Return the network trained on behind the PSF of a file."""
        _tell(f"training on with {psf}: {self.tuning.cpu_minutes:g} CPU-minutes")
        return tuned(self.start, self.checkpoint, psf, read_plate_psf(psf), self.tuning)


def as_designed(trial: Trial) -> Row:
    """Judge the plate without an error."""
    made = etched(trial.plate, 0.0)
    methods = {NETWORK: _network(trial.checkpoint), "linear, design PSF": _told(trial.designed)}
    return {
        "like_design": made.like(trial.designed),
        "methods": _judged(trial, made, methods, "as designed"),
    }


def as_etched(trial: Trial, error: float, control: Checkpoint | None) -> Row:
    """Etch, photograph, measure, train on, and judge behind the PSF that the plate has.

    Args:
        trial: What is judged.
        error: Of the depth of every mask.
        control: The network trained on with the designed PSF, if that is asked for.
    """
    made = etched(trial.plate, error)
    folder = trial.folder / f"{100 * error:+g}_percent"
    psf, seen = measured_psf(made.height_um, trial.plate.camera, trial.designed, folder)
    measured = read_plate_psf(psf)
    apart = likeness(measured.astype(np.float64), made.seen)
    after = trial.trained_on(psf)
    methods = {
        NETWORK: _network(trial.checkpoint),
        "network trained on, measured PSF": _network(after),
    }
    if control is not None:
        methods["network trained on, design PSF"] = _network(control)
    methods |= {
        "linear, design PSF": _told(trial.designed),
        "linear, measured PSF": _told(measured),
        "linear, true PSF": _told(made.kernel),
    }
    return {
        "depth_error": error,
        "like_design": made.like(trial.designed),
        "measured": {
            "correlation": round(apart.correlation, 7),
            "rmse": round(apart.rmse, 6),
            **seen.to_json(),
        },
        "training": ending(after),
        "methods": _judged(trial, made, methods, f"{error:+.0%}"),
    }


def control_of(trial: Trial) -> Checkpoint:
    """Train on with the PSF of the design: what the minutes alone are good for."""
    psf = trial.folder / "design" / "design.safetensors"
    psf.parent.mkdir(parents=True, exist_ok=True)
    write_plate_psf(psf, trial.designed)
    return trial.trained_on(psf)


def scan(trial: Trial, errors: Iterable[float]) -> Iterator[Row]:
    """Return what errors cost without noise."""
    network, told = _network(trial.checkpoint), _told(trial.designed)
    for error in errors:
        _tell(f"scan: {error:+.0%}")
        made = etched(trial.plate, error)
        methods = {
            NETWORK: network,
            "linear, design PSF": told,
            "linear, true PSF": _told(made.kernel),
        }
        scores = {n: scored(trial.sets, made.sampling, m, math.inf) for n, m in methods.items()}
        yield {
            "depth_error": error,
            "like_design": made.like(trial.designed),
            "methods": scores,
        }


def _judged(trial: Trial, made: Etched, methods: Mapping[str, Method], plate: str) -> Row:
    found = {}
    for name, method in methods.items():
        _tell(f"{plate}: {name}")
        found[name] = scored_levels(trial.sets, made.sampling, method)
    return found


def _network(checkpoint: Checkpoint) -> Method:
    network: nn.Module = load_network(checkpoint)
    return network_method(network)


def _told(kernel: FloatArray) -> Method:
    return linear_method(make_sampling("learned", kernel=kernel))


def _tell(line: str) -> None:
    print(line, file=sys.stderr, flush=True)
