"""A capture of single photons -> its product; and what would be done, without doing it."""

import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from camkit.runtime.kinds.spad.files.described import describe
from camkit.runtime.kinds.spad.files.named import named_bundle
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.runtime.kinds.spad.products.depth import make_depth
from camkit.runtime.kinds.spad.products.intensity import make_intensity
from camkit.runtime.kinds.spad.products.lifetime import make_lifetime
from camkit.runtime.kinds.spad.products.record import told_axis, told_way
from camkit.runtime.kinds.spad.products.settings import FINER, identity
from camkit.runtime.kinds.spad.products.survey import Survey, surveyed
from camkit.runtime.kinds.spad.products.transient import make_transient
from camkit.runtime.kinds.spad.sharpen import METHODS
from camkit.runtime.maker import Made, Maker, Making
from camkit.runtime.options import Options

MAKERS: Final = {
    "depth": make_depth,
    "intensity": make_intensity,
    "transient": make_transient,
    "lifetime": make_lifetime,
}
BESIDE: Final[Mapping[str | None, tuple[str, ...]]] = {
    "depth": (".ply", ".png"),
    "intensity": (".png", ".mp4"),
    "transient": (".png", ".mp4"),
    "lifetime": (".png",),
    None: (".ply", ".png", ".mp4"),
}


def make(making: Making) -> Made:
    """Make the product of a capture.

    Raises:
        DecodeError: If it cannot be read.
        ContractError: If capture and options do not fit each other.
        Cancelled: If the caller wished so.
    """
    began = time.perf_counter()
    with surveyed(making) as survey:
        made = MAKERS[survey.product](making, survey, began)
        axis, file = survey.axis, survey.settings.timing_file
        told = {} if axis is None else told_axis(axis)
        named = None if file is None else file.name
        return replace(made, record={**told, **made.record, "timing": named})


def plan(making: Making) -> Mapping[str, Any]:
    """Return what `make` would do; errors as there."""
    with surveyed(making) as survey:
        found: dict[str, Any] = {
            "product": survey.product,
            "width": survey.shape[1],
            "height": survey.shape[0],
            "bins": survey.bins,
        }
        if survey.axis is not None:
            found |= told_axis(survey.axis)
        if survey.product == "depth":
            found |= told_way(survey.settings.way)
        return {
            "size": None,
            "decisions": list(_decisions(making, survey)),
            "estimate": None,
            "plan": found,
            "warnings": list(survey.warnings()),
        }


def _decisions(making: Making, survey: Survey) -> list[dict[str, Any]]:
    way, is_asked = survey.settings.way, survey.settings.product is not None
    of_file = "the capture holds " + ("counts" if survey.axis is None else "times of photons")
    found: list[tuple[str, str, str]] = [
        ("product", survey.product, "asked" if is_asked else of_file)
    ]
    if (file := survey.settings.timing_file) is not None:
        is_named = making.options.chosen("timing") is not None
        found.append(("timing", file.name, "asked" if is_named else "lies beside the capture"))
    if survey.product == "depth":
        pulse = "a pulse is stated" if survey.timing.pulse() is not None else "none is stated"
        found += [
            ("pulse", "stated" if "a pulse" in pulse else "estimated", pulse),
            ("method", way.method, "asked" if "method" in survey.settings.chosen else "default"),
            ("neighbours", *_neighbours(survey)),
            (
                "second return",
                "sought" if way.returns == 2 else "left out",
                "only where the residual of one asks for it" if way.returns == 2 else "not asked",
            ),
        ]
    if survey.camera is not None:
        found += _finer(survey, survey.camera)
    cycles = survey.timing.timing.cycles
    reason = f"{cycles} cycles are stated" if cycles else "no cycles are stated"
    found.append(("pile-up", "corrected" if cycles else "left as it is", reason))
    return [
        {"what": what, "choice": choice, "reason": reason, "saving_s": 0.0, "cost_db": 0.0}
        for what, choice, reason in found
    ]


def _neighbours(survey: Survey) -> tuple[str, str]:
    pool = survey.settings.way.pool
    if survey.camera is not None:
        return "weighed", "the estimate of the fine grid takes as many as the light demands"
    return pool, "only where one pixel has too few photons" if pool == "auto" else "asked"


def _finer(survey: Survey, camera: FineCamera) -> list[tuple[str, str, str]]:
    """Return how pictures become finer behind a plate, as the capture's light will decide."""
    size, asked = survey.size_of_pictures, survey.settings.finer is not None
    network = "linear" if size is None else f"network {size}"
    if asked or size is None:
        reason = "asked" if asked else "the bundle holds no network"
        return [("finer", network, reason)]
    if survey.product == "depth":
        least = camera.stage.network_from_photons
        return [
            (
                "finer",
                f"{network} or linear",
                f"the network from {least:g} signal photons of a pixel on, nearer to the truth "
                "there; below, the linear estimate; a larger network brings times little nearer",
            )
        ]
    return [
        ("finer", network, "the best that the bundle has"),
        ("empty frames", "skipped", "a frame without photons stays dark"),
    ]


def stem(path: Path) -> str:
    """Return the name of a capture without its type; NAME.sdt.zip is NAME."""
    return Path(path.stem).stem if path.name.lower().endswith(".sdt.zip") else path.stem


def _beside(options: Options) -> tuple[str, ...]:
    return BESIDE[options.chosen("product")]


MAKER: Final = Maker(
    make=make,
    plan=plan,
    suffix=".npz",
    beside=_beside,
    formats={"exr": ".exr", "tiff": ".tif"},
    methods=(*METHODS, *FINER),
    with_bundle=frozenset({"size"}),
    identity=identity,
    named=named_bundle,
    describe=describe,
    stem=stem,
)
