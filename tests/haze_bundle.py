"""A tiny camera whose optics have a haze: core kernels of 5 px and cells of 8, made by formula."""

from pathlib import Path
from typing import Any

import numpy as np

from camkit.bundle.chain import rewired
from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.manifest import Manifest
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.stages import Dehaze, Stage, Wiener
from camkit.bundle.writer import write_bundle
from tests.bundle_factory import tiny_manifest, tiny_psf, tiny_stages
from tests.haze_factory import CELL_PX, tiny_haze


def hazy_optics() -> FrozenOptics:
    """Give the tiny PSF as a core, with its haze."""
    return FrozenOptics(psf=tiny_psf(), haze=tiny_haze())


def hazy_stages(*, network: bool = False, **changes: Any) -> tuple[Stage, ...]:
    """Give the usual stages, with or without a network, the haze undone before the bank."""
    usual: list[Stage] = []
    for stage in tiny_stages():
        if isinstance(stage, Wiener):
            usual.append(Dehaze(**({"shrink": CELL_PX} | changes)))
            usual.append(stage.model_copy(update={"takes": ("clear", "unknown")}))
        else:
            usual.append(stage)
    return rewired([stage for stage in usual if network or stage.type != "network"], usual)


def hazy_manifest(**changes: Any) -> Manifest:
    """Give its manifest, without members."""
    fields: dict[str, Any] = {
        "format_version": "2.7",
        "optics": hazy_optics().entry(np.inf),
        "stages": hazy_stages(),
        "networks": {},
        "golden": (),
    }
    return tiny_manifest(**(fields | changes))


def write_hazy_bundle(folder: Path, **changes: Any) -> Bundle:
    """Write the bundle and open it."""
    path = folder / "hazy.camkit"
    write_bundle(path, hazy_manifest(**changes), hazy_optics().members)
    return open_bundle(path)
