"""Captures with a known truth: the golden cases as stored, or pictures of a folder photographed.

golden     capture and sharp reference of the bundle; through the bundle's own PSF
pictures   five field positions, two sensitivities, fabricated lenses traced afresh where the
           bundle holds its prescription and torch is there (`camkit.report.quality`)
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from importlib import util
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.golden import golden_from_bytes
from camkit.bundle.reader import GOLDEN, PRESCRIPTION, Bundle
from camkit.colorimetry import encode_srgb
from camkit.contracts import FloatArray, FrozenPsf
from camkit.errors import ContractError
from camkit.report.fabricated_psf import fabricated_psf
from camkit.report.quality import (
    FIELD_SHARES,
    PsfSource,
    Shot,
    expose,
    list_set,
    read_picture,
)

ISOS: Final = (100.0, 1600.0)
MOST_PX: Final = 1024
"""Of a larger picture the middle is taken."""
LEAST_PX: Final = 96
"""Of a smaller one too little would be left inside the border."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownCapture:
    """A capture and what a perfect camera would have made of it.

    Attributes:
        picture: Name of the picture; captures of one picture share it.
        caption: What distinguishes the capture, for people.
        psf: Lens of the capture: fresh (fabricated, traced afresh) or bundle.
        capture: (h, w) mosaic in DN or (3, h, w) linear.
        iso: Sensitivity.
        white_balance: Gains (R, G, B).
        origin_px: (x, y) on the sensor.
        undistort: Whether the truth is in ideal geometry; else in that of the sensor.
        sharp: (3, h, w) float32 sRGB values.
    """

    picture: str
    caption: str
    psf: PsfSource
    capture: NDArray[Any]
    iso: float
    white_balance: tuple[float, float, float] | None
    origin_px: tuple[int, int]
    undistort: bool
    sharp: FloatArray


def golden_captures(bundle: Bundle) -> list[KnownCapture]:
    """Give the golden cases of a bundle that are large enough to be judged."""
    cases = bundle.manifest.golden
    arrays = golden_from_bytes(bundle.member(GOLDEN)) if cases else {}
    return [
        KnownCapture(
            picture=case.name,
            caption=f"golden case {case.name}, ISO {case.iso:g}",
            psf="bundle",
            capture=np.ascontiguousarray(arrays[case.name].capture),
            iso=case.iso,
            white_balance=case.white_balance,
            origin_px=case.origin_px,
            undistort=True,
            sharp=encode_srgb(arrays[case.name].reference),
        )
        for case in cases
        if min(arrays[case.name].reference.shape[1:]) >= LEAST_PX
    ]


def picture_captures(
    bundle: Bundle, folder: Path, count: int | None, cache_folder: Path
) -> Iterator[KnownCapture]:
    """Photograph the first pictures of a folder at every place and sensitivity.

    Args:
        bundle: The camera.
        folder: Sharp pictures.
        count: How many of them; None for all.
        cache_folder: Where traced PSFs are kept.

    Raises:
        ContractError: If the folder holds no pictures, or one is too small.
    """
    camera = bundle.manifest.camera
    most_px = min(MOST_PX, camera.width_px, camera.height_px)
    psf = psf_source(bundle)

    @lru_cache(maxsize=4)
    def lens(seed: int) -> FrozenPsf:
        return fabricated_psf(bundle, seed, cache_folder=cache_folder)

    for number, path in enumerate(list_set(folder, count)):
        scene = read_picture(path, most_px)
        if min(scene.shape[1:]) < LEAST_PX:
            raise ContractError(
                f"{path} has {scene.shape[2]}x{scene.shape[1]} pixels; a picture to measure on "
                f"needs {LEAST_PX} a side"
            )
        for position, share in enumerate(FIELD_SHARES):
            for iso in ISOS:
                shot = Shot(
                    set_name=folder.name,
                    picture=path,
                    number=number,
                    position=position,
                    iso=iso,
                    psf=psf,
                )
                kernels = lens(shot.fabrication_seed) if psf == "fresh" else bundle.psf
                yield _photograph(shot, scene, bundle, kernels, share)


def psf_source(bundle: Bundle) -> PsfSource:
    """Tell through which lens pictures are photographed: fresh, if it can be traced here."""
    traceable = PRESCRIPTION in bundle.names and util.find_spec("torch") is not None
    return "fresh" if traceable else "bundle"


def _photograph(
    shot: Shot, scene: FloatArray, bundle: Bundle, lens: FrozenPsf, share: float
) -> KnownCapture:
    exposed = expose(shot, scene, bundle, lens)
    simulation = exposed.simulation
    x, y = (int(v) for v in simulation.window.origin_px)
    return KnownCapture(
        picture=shot.picture.name,
        caption=f"{shot.picture.stem}, {share:.0%} of the way to the corner, ISO {shot.iso:g}",
        psf=shot.psf,
        capture=simulation.mosaic,
        iso=simulation.iso,
        white_balance=simulation.white_balance,
        origin_px=(x, y),
        undistort=False,
        sharp=exposed.sharp,
    )
