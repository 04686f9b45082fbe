"""A lens as two pictures of one plane saw it, from every origin of distances: needs torch."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.calibrate.pair_scene import PairScene
from camkit.calibrate.pair_words import PairWords
from camkit.errors import ContractError
from camkit.models_def.face.recipe_writing import with_fields_of
from camkit.models_def.optics.lens_file.lens_file import read_noted_lens
from camkit.models_def.optics.lens_file.placing import (
    DISTANCE_ORIGINS,
    Placement,
    placed_lens,
    stopped_lens,
)
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.render.pair_transfer import BlockPlaces, PairRays, trace_pair
from camkit.models_def.sensors.sensor_choice import choose_sensor
from camkit.units import MM_PER_M, UM_PER_MM

STEP_PX: Final = 0.5
"""By which a step of the sensor changes the diameter of the blur, about."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlacedPair:
    """The lens at both stops, by what distances count from.

    Attributes:
        rays: Origin -> those of the wide and the sharp lens, focused on what was stated.
        step_mm: Shift of the sensor that changes the blur by half a pixel.
        notes: What of the lens file was left out, and which origins cannot be.
    """

    rays: dict[str, PairRays]
    step_mm: float
    notes: tuple[str, ...]

    def transfers(self, origin: str, defocus_mm: float) -> list[NDArray[np.complex128]]:
        """Return what blurs the sharp picture into the wide one, block by block."""
        return self.rays[origin].transfers(defocus_mm)


def place_pair(path: Path, words: PairWords, object_m: float, scene: PairScene) -> PlacedPair:
    """Read a lens, stop it, focus it and place a plane, from every origin that may be.

    Raises:
        ContractError: If it can be focused from no origin, or the sharp stop is the wider one.
    """
    glass = tuple(map(str, words.glass))
    design, notes = read_noted_lens(path, glass, words.catalogue, words.configuration)
    size = f"{scene.grid.width}x{scene.grid.height}@{scene.pitch_um:.6f}um:planes"
    design = with_fields_of(design, choose_sensor(size))
    origins = DISTANCE_ORIGINS if words.distance_from is None else (words.distance_from,)
    lenses: dict[str, tuple[Lens, Lens]] = {}
    refusals = []
    for origin in origins:
        placement = Placement(
            f_number=words.f_number,
            stop_radius_mm=words.stop_radius_mm,
            focus_mm=words.focus_m * MM_PER_M,
            objects_mm=(object_m * MM_PER_M,),
            origin=origin,  # type: ignore[arg-type]
        )
        try:
            in_use = placed_lens(design, placement)
        except ContractError as error:
            refusals.append(str(error))
            continue
        wide = replace(in_use.lens, object_distance_mm=in_use.objects_mm[0])
        lenses[origin] = wide, _sharp(wide, words)
    if not lenses:
        raise ContractError(refusals[0])
    f_number = abs(paraxial_data(next(iter(lenses.values()))[0]).f_number)
    places = _places(scene)
    return PlacedPair(
        rays={origin: trace_pair(*both, places) for origin, both in lenses.items()},
        step_mm=STEP_PX * scene.pitch_um / UM_PER_MM * f_number,
        notes=(*notes, *refusals),
    )


def _places(scene: PairScene) -> BlockPlaces:
    """Return the middles of the blocks."""
    blocks = scene.grid.blocks()
    down, across = scene.grid.frequencies
    return BlockPlaces(
        y_px=np.array([block.y_px for block in blocks]),
        x_px=np.array([block.x_px for block in blocks]),
        pitch_um=scene.pitch_um,
        down=down,
        across=across,
    )


def _sharp(wide: Lens, words: PairWords) -> Lens:
    """Return the lens stopped down, its sensor unmoved.

    Raises:
        ContractError: If the stop is not the smaller one.
    """
    sharp = stopped_lens(
        wide, f_number=words.sharp_f_number, stop_radius_mm=words.sharp_stop_radius_mm
    )
    radii = [paraxial_data(lens).stop_semi_diameter_mm for lens in (wide, sharp)]
    if radii[1] >= radii[0]:
        raise ContractError(
            f"the stop of the sharp picture, {radii[1]:.3g} mm, is not smaller than that of the "
            f"wide one, {radii[0]:.3g} mm"
        )
    return sharp
