"""camkit: computational cameras from design to daily use.

The public face, free of torch and loaded only when touched:

    camkit.load(bundle)            a live Pipeline from a bundle's name or path
    camkit.process(files, ...)     captures in, pictures and sidecars out
    camkit.WorkerPool(bundle, ...) processes with a camera loaded, for services
    camkit.view(results, ...)      results on one page, to look at
    camkit.simulate(scene, ...)    a sharp scene to a capture of a camera
    camkit.portable(bundle, ...)   a camera as graphs for programs without camkit
    camkit.calibrate               measurements of a camera: calibrate.noise(...), ...
    camkit.make(lens, ...)         a lens and a sensor to a proved bundle (needs torch)
    camkit.recipe(lens, ...)       a lens and a sensor to a training recipe (needs torch)
    camkit.freeze(optics, ...)     optics to a frozen PSF (needs torch)
    camkit.train(recipe, ...)      a recipe to a checkpoint (needs torch)
    camkit.export.bundle(...)      checkpoints and PSF to a bundle (needs torch)
    camkit.Pipeline                the type that `load` returns
    camkit.CamkitError, ...        the error tree of camkit.errors

The folders, in the order in which data passes through them: `models_def` (design time: optics,
sensors, networks, training), `export` (bundle out), `bundle` (the file both sides agree on),
`runtime` (use time), `calibration` (what a camera is, measured), `report`, `calibrate` and `cli`
(for people).
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from camkit import calibrate, export
    from camkit.errors import (
        BundleError,
        CamkitError,
        ContractError,
        DecodeError,
        MemoryCapError,
        ParityError,
        UnsupportedError,
        WorkerError,
    )
    from camkit.models_def.face.network_training import train
    from camkit.models_def.face.optics_freezing import freeze
    from camkit.models_def.face.recipe_writing import CameraWords, recipe
    from camkit.report.making.camera_making import make
    from camkit.report.view.page_making import ViewPage, view
    from camkit.runtime.batch import process
    from camkit.runtime.batch.worker_pool import WorkerPool
    from camkit.runtime.cancel import Cancelled
    from camkit.runtime.capture import MosaicOptions
    from camkit.runtime.development import FileResult
    from camkit.runtime.face.portable_writing import portable
    from camkit.runtime.face.simulation import simulate
    from camkit.runtime.pipeline import Pipeline, load

__all__ = [
    "BundleError",
    "CameraWords",
    "CamkitError",
    "Cancelled",
    "ContractError",
    "DecodeError",
    "FileResult",
    "MemoryCapError",
    "MosaicOptions",
    "ParityError",
    "Pipeline",
    "UnsupportedError",
    "ViewPage",
    "WorkerError",
    "WorkerPool",
    "__version__",
    "calibrate",
    "export",
    "freeze",
    "load",
    "make",
    "portable",
    "process",
    "recipe",
    "simulate",
    "train",
    "view",
]

__version__ = "0.2.0"

_HOMES = {
    "load": "camkit.runtime.pipeline",
    "Pipeline": "camkit.runtime.pipeline",
    "process": "camkit.runtime.batch",
    "WorkerPool": "camkit.runtime.batch.worker_pool",
    "FileResult": "camkit.runtime.development",
    "Cancelled": "camkit.runtime.cancel",
    "MosaicOptions": "camkit.runtime.capture",
    "portable": "camkit.runtime.face.portable_writing",
    "simulate": "camkit.runtime.face.simulation",
    "freeze": "camkit.models_def.face.optics_freezing",
    "make": "camkit.report.making.camera_making",
    "recipe": "camkit.models_def.face.recipe_writing",
    "CameraWords": "camkit.models_def.face.recipe_writing",
    "train": "camkit.models_def.face.network_training",
    "view": "camkit.report.view.page_making",
    "ViewPage": "camkit.report.view.page_making",
}
_PACKAGES = {"calibrate": "camkit.calibrate", "export": "camkit.export"}


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module 'camkit' has no attribute {name!r}")
    if name in _PACKAGES:
        return import_module(_PACKAGES[name])
    return getattr(import_module(_HOMES.get(name, "camkit.errors")), name)


def __dir__() -> list[str]:
    return __all__
