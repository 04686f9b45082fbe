"""Whole frames of a camera with a haze, photographed and cleared, for training: a patch holds none.

    crops of pictures -> a scene of the whole sensor -> light through a copy of the lens
        -> shots at ISOs of their own -> the runtime, up to the stage `haze` -> tiles

Networks are trained on what the runtime gives them: nothing of it is written again for training
(`samples` takes the tiles through the bank).
"""

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.chain import rewired
from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.reader import PRESCRIPTION, Bundle
from camkit.bundle.stages import Network
from camkit.bundle.writer import write_physics
from camkit.colorimetry import apply_matrix, camera_from_rec709
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.frames.tiles import (
    PARTS,
    Tile,
    Tiles,
    create_tiles,
    frames_folder,
    write_header,
)
from camkit.models_def.kinds.bayer.psf_bank import PsfBank
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.kinds.bayer.samples import tint_crop
from camkit.models_def.optics.frozen import corner_height_mm
from camkit.models_def.optics.kernel_bank import focused_copies
from camkit.models_def.optics.prescription import Lens, format_prescription
from camkit.models_def.optics.thin.hazy_freezing import COPY_RAYS, HazyGrid, freeze_hazy
from camkit.models_def.optics.thin.middle import find_middles
from camkit.models_def.training.kind import training_kind
from camkit.models_def.training.pictures import DrawnShares, SceneSource, list_pictures, open_scenes
from camkit.psf import depth_name
from camkit.runtime.bank.haze import hazy_kernels
from camkit.runtime.geometry.illumination import illumination_band
from camkit.runtime.options import Options
from camkit.runtime.twin.exposure import Setting, expose
from camkit.runtime.twin.light import Light, LightOptions, lens_of, light_of, scene_window
from camkit.units import to_mm

Tell = Callable[[str], None]
Generator = np.random.Generator

SPREAD_EV: Final = 0.7
"""How much crops of a frame differ in their exposure."""
VALIDATION_ISOS: Final = (100.0, 1600.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameSources:
    """The sources of frames: pictures, camera and optics.

    Attributes:
        pictures: Part of `PARTS` -> folder of pictures; None for procedural scenes alone.
        optics: Core kernels and haze of the lens as designed.
        copies: Of its fabricated copies, those to choose by last.
        designed: The lens as a bundle holds it.
        seed: Of scenes, places, ISOs and noise.
    """

    pictures: Mapping[str, Path | None]
    optics: FrozenOptics
    copies: Sequence[FrozenOptics]
    designed: Mapping[str, bytes]
    seed: int = 0


def check_frames(recipe: BayerRecipe, pictures: Mapping[str, Path | None] | None = None) -> None:
    """Refuse sources that no frames can be made of, before anything takes long.

    Raises:
        ContractError: If the recipe undoes no haze, its tiles do not fit the sensor, or a folder
            holds no pictures.
    """
    if recipe.haze is None:
        raise ContractError(
            f"{recipe.name} has no haze; its samples are made while it trains, leave prepare out"
        )
    extent, data = recipe.sensor.known_extent, recipe.data
    room = min(extent.width_px, extent.height_px)
    if data.sample_px > room or data.margin_px >= room:
        raise ContractError(
            f"tiles need a sensor of at least data.sample_px ({data.sample_px}) and more than "
            f"data.margin_px ({data.margin_px}); got {extent.width_px}x{extent.height_px} px"
        )
    for folder in (pictures or {}).values():
        list_pictures(folder)


def freeze_copies(recipe: BayerRecipe, lens: Lens, tell: Tell) -> tuple[FrozenOptics, ...]:
    """Freeze core and haze of the fabricated copies of a lens, those to choose by last.

    Where the recipe has distances, every copy is frozen for an object at one of them, in turn. All
    light is gathered about what that of the lens itself is, so that pictures lie in one place.

    Raises:
        ContractError: If no peak of a copy reaches the corner.
    """
    choices, sensor = recipe.lens, recipe.sensor
    count = choices.copies + choices.validation_copies
    pitch_um = sensor.pixel_pitch_um
    corner_px = corner_height_mm(sensor) / to_mm(pitch_um)
    grid = HazyGrid(rays=COPY_RAYS)
    middle = find_middles(lens, corner_px, pitch_um, grid.rays).middle
    frozen: list[FrozenOptics] = []
    for number, copy in enumerate(focused_copies(lens, 1 + count, choices.seed)[1:]):
        stated_mm = choices.distance_of(number)
        distance_mm = lens.object_distance_mm if stated_mm is None else stated_mm
        focused = replace(copy, object_distance_mm=distance_mm)
        frozen.append(freeze_hazy(focused, sensor, grid, middle=middle)[0])
        at = "" if stated_mm is None else f" at {depth_name(stated_mm)}"
        tell(f"copy {len(frozen)} of {count} frozen{at}")
    return tuple(frozen)


def designed_lens(lens: Lens) -> dict[str, bytes]:
    """Return a lens as a bundle holds it."""
    return {PRESCRIPTION: format_prescription(lens).encode()}


def prepare_frames(
    recipe: BayerRecipe, sources: FrameSources, runs: Path, tell: Tell
) -> dict[str, Any]:
    """Photograph the frames of a recipe and cut their tiles.

    Args:
        recipe: Of a camera with a haze.
        sources: Pictures and optics.
        runs: The folder of its runs; see `frames_folder`.
        tell: Takes a line for every frame.

    Returns:
        What was made: folder, tiles of every part, bytes.

    Raises:
        ContractError: As `check_frames`.
    """
    check_frames(recipe, sources.pictures)
    folder, choices = frames_folder(runs, recipe), recipe.frames
    folder.mkdir(parents=True, exist_ok=True)
    first_unseen = len(sources.copies) - recipe.lens.validation_copies
    plans = {
        PARTS[0]: (choices.count, choices.tiles, range(first_unseen)),
        PARTS[1]: (
            choices.validation_count,
            choices.validation_tiles,
            range(first_unseen, len(sources.copies)),
        ),
    }
    counts = {}
    with tempfile.TemporaryDirectory() as scratch:
        bundle = physics_bundle(recipe, sources.optics, Path(scratch) / "physics.camkit")
        for part, (frames, tiles, copies) in plans.items():
            studio = _Studio(recipe, sources, part, bundle, tiles)
            counts[part] = frames * choices.shots * tiles
            store = create_tiles(folder, part, counts[part], recipe)
            for number in range(frames):
                studio.fill(store, number, copies[number % len(copies)])
                tell(f"{part}: frame {number + 1} of {frames}")
    bank = _bank(recipe, sources)
    write_header(folder, recipe, bank, sources.pictures, sources.designed)
    size = sum(path.stat().st_size for path in folder.iterdir())
    return {"folder": str(folder), **counts, "bytes": size}


def physics_bundle(recipe: BayerRecipe, optics: FrozenOptics, out: Path) -> Bundle:
    """Write the camera of a recipe without its networks, and open it."""
    design = training_kind(recipe.kind).design(recipe)
    physics = [stage for stage in design.stages if not isinstance(stage, Network)]
    stages = rewired(physics, design.stages)
    identity = {"kind": recipe.kind, "name": recipe.name}
    return write_physics(out, stages, recipe.sensor, optics, design.object_distance_mm, **identity)


class _Studio:
    """Photographs the frames of one part."""

    def __init__(
        self, recipe: BayerRecipe, sources: FrameSources, part: str, bundle: Bundle, tiles: int
    ) -> None:
        from camkit.runtime.pipeline import Pipeline  # training does without onnxruntime

        data = recipe.data
        self._recipe, self._sources, self._tiles = recipe, sources, tiles
        self._choosing = part == PARTS[1]
        self._pipeline = Pipeline(bundle, Options(threads=1))
        self._scenes = open_scenes(
            data,
            sources.pictures[part],
            picture_share=1.0 if self._choosing else None,
            first_scene=-data.procedural_scenes if self._choosing else 0,
            drawn_shares=DrawnShares() if self._choosing else data.drawn_shares,
        )

    def fill(self, store: Tiles, number: int, copy: int) -> None:
        """Photograph a frame and store its tiles."""
        recipe, seed = self._recipe, self._sources.seed
        rng = np.random.default_rng((seed, int(self._choosing), number))
        scene = draw_scene(rng, self._scenes, recipe, even=self._choosing)
        window = scene_window(scene, recipe.sensor, None)
        scene, truth = recipe.data.lit(rng, scene)
        matrix, _ = camera_from_rec709(np.array(recipe.sensor.color_matrix))
        lit = scene if scene.min() >= 0 else _visible_part(scene, matrix)
        optics = self._sources.copies[copy]
        light = light_of(
            lit,
            recipe.sensor,
            lens_of(optics.psf, recipe.sensor, haze=optics.haze),
            window,
            LightOptions(distort=False),
        )
        if truth is not lit:
            light = replace(light, clean=np.maximum(apply_matrix(matrix, truth), 0))
        for shot in range(recipe.frames.shots):
            iso = self._iso(rng, shot)
            first = (number * recipe.frames.shots + shot) * self._tiles
            setting = Setting(iso=iso, seed=int(rng.integers(2**31)))
            samples = expose(light, recipe.sensor, setting)
            cut = self._cut(rng, light, samples, iso=iso, copy=copy)
            for index, tile in enumerate(cut, start=first):
                store.store(index, tile)

    def _iso(self, rng: Generator, shot: int) -> float:
        if self._choosing:
            return VALIDATION_ISOS[shot % len(VALIDATION_ISOS)]
        data = self._recipe.data
        return float(np.exp(rng.uniform(np.log(data.iso_min), np.log(data.iso_max))))

    def _cut(
        self,
        rng: Generator,
        light: Light,
        samples: NDArray[np.uint16],
        *,
        iso: float,
        copy: int,
    ) -> Iterator[Tile]:
        """Yield the tiles of a shot."""
        recipe = self._recipe
        sensor, inner, margin = recipe.sensor, recipe.data.sample_px, recipe.data.margin_px
        planes, rise = self._cleared(light, samples, iso)
        clipped = (samples >= np.floor(sensor.white_level))[None]
        for top, left in _places(rng, samples.shape, inner, self._tiles):
            sharp = light.clean[:, top : top + inner, left : left + inner]
            if light.vignetting is not None:
                even = illumination_band(light.vignetting, light.window, top, top + inner)
                sharp = sharp * even[:, left : left + inner]
            middle = (inner - 1) / 2
            x_mm, y_mm = light.window.to_mm(left + middle, top + middle)
            yield Tile(
                planes=_with_surroundings(planes, top, left, inner, margin),
                clipped=_with_surroundings(clipped, top, left, inner, margin)[0],
                sharp=sharp,
                x_mm=float(x_mm),
                y_mm=float(y_mm),
                iso=iso,
                noise_rise=rise,
                copy=copy,
            )

    def _cleared(
        self, light: Light, samples: NDArray[np.uint16], iso: float
    ) -> tuple[FloatArray, tuple[float, float, float]]:
        """Return a shot without haze, by the stage haze, and the factor on its noise."""
        haze = self._recipe.haze
        assert haze is not None
        capture = self._pipeline.capture_of(
            samples,
            iso=iso,
            white_balance=light.gains,  # type: ignore[arg-type]
            origin_px=(0, 0),
        )
        dehazed = self._pipeline.start(capture).keep(haze.gives[0])
        rows = dehazed.rows()
        assert dehazed.noise_rise is not None
        red, green, blue = dehazed.noise_rise()
        return np.asarray(rows.read(0, rows.shape[1]), np.float32), (red, green, blue)


def _visible_part(scene: FloatArray, matrix: NDArray[np.float64]) -> FloatArray:
    """Return a scene (3, h, w) of colours outside Rec.709 without what no channel sees."""
    camera = np.maximum(apply_matrix(matrix, scene), 0)
    back = np.asarray(np.linalg.inv(matrix), np.float64)
    return np.asarray(apply_matrix(back, camera), np.float32)


def draw_scene(
    rng: Generator, source: SceneSource, recipe: BayerRecipe, *, even: bool = False
) -> FloatArray:
    """Draw a scene of the whole sensor, (3, h, w) float32 linear Rec.709.

    Args:
        rng: Draws crops, tints and exposures.
        source: Of the crops.
        recipe: Its frames and exposures.
        even: Leave tints and exposures as they are.
    """
    extent, data, side = recipe.sensor.known_extent, recipe.data, recipe.frames.crop_px
    scene = np.empty((3, extent.height_px, extent.width_px), np.float32)
    least, most = data.exposure_min_ev, data.exposure_max_ev
    usual = rng.triangular(least, min(max(0.0, least), most), most) if most > least else most
    for top in range(0, extent.height_px, side):
        for left in range(0, extent.width_px, side):
            place = scene[:, top : top + side, left : left + side]
            crop = source.draw_crop(rng, side)
            if not even:
                stops = np.clip(usual + SPREAD_EV * rng.standard_normal(), least, most)
                crop = tint_crop(rng, crop) * np.float32(2.0**stops)
            place[:] = crop[:, : place.shape[1], : place.shape[2]]
    return np.maximum(scene, 0, out=scene)


def _places(
    rng: Generator, size: tuple[int, ...], side_px: int, count: int
) -> Iterator[tuple[int, int]]:
    """Yield the first pixels of tiles, anywhere in the frame, on the mosaic's cell."""
    rooms = [(length - side_px) // 2 + 1 for length in size]
    for _ in range(count):
        top, left = (2 * int(rng.integers(room)) for room in rooms)
        yield top, left


def _with_surroundings(
    planes: NDArray[Any], top: int, left: int, inner_px: int, margin_px: int
) -> NDArray[Any]:
    """Cut a square and what lies around it; mirrored beyond the border of the frame."""

    def indices(first: int, length: int) -> NDArray[np.intp]:
        at = np.abs(np.arange(first - margin_px, first + inner_px + margin_px))
        return np.where(at < length, at, 2 * (length - 1) - at)

    height, width = planes.shape[-2:]
    rows, columns = indices(top, height), indices(left, width)
    return np.ascontiguousarray(planes[:, rows[:, None], columns])


def _bank(recipe: BayerRecipe, sources: FrameSources) -> PsfBank:
    """Return the core kernels as training asks for them; copies have the fields of the lens."""

    def core(optics: FrozenOptics) -> FloatArray:
        assert optics.haze is not None
        response = recipe.sensor.response_arrays()
        return hazy_kernels(optics.psf, optics.haze, *response).core.kernels

    heights = sources.optics.psf.field_heights_mm
    return PsfBank(
        copies=np.stack([core(copy) for copy in sources.copies]),
        copy_heights_mm=heights,
        frozen=core(sources.optics),
        frozen_heights_mm=heights,
        relative_illumination=sources.optics.psf.relative_illumination,
        validation_copies=recipe.lens.validation_copies,
    )
