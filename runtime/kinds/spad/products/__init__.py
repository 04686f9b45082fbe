"""Products of counts: arrays first, and pictures for people beside them.

depth      depth, time of flight, amplitude and what goes with them
frames     pictures, films and light in flight
lifetime   how long fluorescence takes to fade
decisions  what would be done, and why
record     what a sidecar and a plan say of how a capture is worked through
archive    NAME.npz
points     NAME.ply
preview    NAME.png
video      NAME.mp4
picture    NAME.exr, NAME.tif
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

from camkit.bundle.golden import IMAGE
from camkit.runtime.capture_result import Result
from camkit.runtime.job.reconstruction import Reconstruction
from camkit.runtime.kind_parts.product_files import product_outputs
from camkit.runtime.kinds.spad.captures.photon_capture import PhotonCapture, photons_of
from camkit.runtime.kinds.spad.captures.settings import Product, identity
from camkit.runtime.kinds.spad.products.depth import make_depth
from camkit.runtime.kinds.spad.products.frames import make_intensity, make_transient
from camkit.runtime.kinds.spad.products.lifetime import make_lifetime
from camkit.runtime.kinds.spad.products.record import told_axis
from camkit.runtime.options import Options

MAKERS: Final[Mapping[Product, Callable[[Reconstruction, PhotonCapture, str], Result]]] = {
    "depth": make_depth,
    "intensity": make_intensity,
    "transient": make_transient,
    "lifetime": make_lifetime,
}
PLANES: Final[Mapping[str, str]] = {
    "depth": "depth",
    "intensity": "photons",
    "transient": "photons",
    "lifetime": "lifetime",
}
"""Product -> plane of the usual stages, without a bundle."""
BESIDE: Final[Mapping[str | None, tuple[str, ...]]] = {
    "depth": (".ply", ".png"),
    "intensity": (".png", ".mp4"),
    "transient": (".png", ".mp4"),
    "lifetime": (".png",),
    None: (".ply", ".png", ".mp4"),
}


def make(work: Reconstruction) -> Result:
    """Return the product of a capture; errors as of `make_depth`."""
    capture = photons_of(work.job)
    made = MAKERS[capture.product](work, capture, _name_of(work, capture.product))
    axis, file = capture.axis, capture.settings.timing_file
    told = {} if axis is None else told_axis(axis)
    named = None if file is None else file.name
    shape = next(iter(made.arrays.values())).shape
    return replace(made, shape=shape, record={**told, **made.record, "timing": named})


def _name_of(work: Reconstruction, product: Product) -> str:
    """Return the name of what a bundle makes of a capture: its image, or what comes first."""
    products = work.products
    if work.job.bundle is None or IMAGE in products:
        return product if work.job.bundle is None else IMAGE
    given = [plane for stage in work.job.setup.stages for plane in stage.gives]
    return min(products, key=lambda name: given.index(products[name]))


def _stem(path: Path) -> str:
    """Return the name of a capture without its type; NAME.sdt.zip is NAME."""
    return Path(path.stem).stem if path.name.lower().endswith(".sdt.zip") else path.stem


def _beside(options: Options) -> tuple[str, ...]:
    return BESIDE[options.chosen("product")]


OUTPUTS: Final = product_outputs(
    make,
    suffix=".npz",
    beside=_beside,
    formats={"exr": ".exr", "tiff": ".tif"},
    identity=identity,
    stem=_stem,
)
