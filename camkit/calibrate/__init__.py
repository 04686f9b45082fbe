"""A camera measured from photographs: one function for each command of `camkit calibrate`.

    camkit.calibrate.noise(darks, flats, "noise.toml").to_record()

photographs     psf, noise, flat, geometry
displays        targets, tone, pairs
camera_bundles  bundle, lensfun_in, lensfun_out
lens_blur       blur, from ordinary photographs
body_focus      camera_body, as `camkit freeze --unit`
foreign_psf     import_psf, as `camkit psf import`
lens_distance   distance, with `PairWords` of pair_words
pair_scene, placed_pair    its pictures, and its lens from every origin
result_files, result_folder    the files of the results, written all or none

What is measured is in `camkit.calibration`; a result gives its facts by `to_record()`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from camkit.calibrate.body_focus import camera_body
    from camkit.calibrate.camera_bundles import bundle, lensfun_in, lensfun_out
    from camkit.calibrate.displays import pairs, targets, tone
    from camkit.calibrate.foreign_psf import import_psf
    from camkit.calibrate.lens_blur import blur
    from camkit.calibrate.lens_distance import distance
    from camkit.calibrate.pair_words import PairWords
    from camkit.calibrate.photographs import flat, geometry, noise, psf

__all__ = [
    "PairWords",
    "blur",
    "bundle",
    "camera_body",
    "distance",
    "flat",
    "geometry",
    "import_psf",
    "lensfun_in",
    "lensfun_out",
    "noise",
    "pairs",
    "psf",
    "targets",
    "tone",
]

_HOMES: Final = {
    "PairWords": "camkit.calibrate.pair_words",
    "blur": "camkit.calibrate.lens_blur",
    "bundle": "camkit.calibrate.camera_bundles",
    "camera_body": "camkit.calibrate.body_focus",
    "distance": "camkit.calibrate.lens_distance",
    "import_psf": "camkit.calibrate.foreign_psf",
    "lensfun_in": "camkit.calibrate.camera_bundles",
    "lensfun_out": "camkit.calibrate.camera_bundles",
    "pairs": "camkit.calibrate.displays",
    "targets": "camkit.calibrate.displays",
    "tone": "camkit.calibrate.displays",
}


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module 'camkit.calibrate' has no attribute {name!r}")
    return getattr(import_module(_HOMES.get(name, "camkit.calibrate.photographs")), name)


def __dir__() -> list[str]:
    return __all__
