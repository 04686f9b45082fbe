"""A recipe turned into the parts of a loop."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import torch
from torch import Tensor, nn

from camkit.cfa import CFA_PATTERNS
from camkit.errors import ContractError
from camkit.models_def.design.descent import Descending, descended
from camkit.models_def.design.design_recipe import DesignRecipe, OpticsRecipe, PhaseRecipe
from camkit.models_def.design.lens import DesignLens
from camkit.models_def.design.lens_module import (
    WIDEST_PX,
    LensModule,
    design_models,
    fitting_window_px,
)
from camkit.models_def.design.library import Start, library_start
from camkit.models_def.design.loop import DesignLoop, DesignParts
from camkit.models_def.design.sensor import Recorder
from camkit.models_def.design.shipped_camera import Camera
from camkit.models_def.design.starts import Starts, best_judged, found_starts
from camkit.models_def.design.states_module import StatesModule
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.networks.catalog import build_network, check_patch
from camkit.models_def.optics.analysis.psf_model import PsfRegime, checked_regime
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.lens_file.states import plain_lens
from camkit.models_def.optics.optics_file import ALL, state_names
from camkit.models_def.optics.paraxial import paraxial_image
from camkit.models_def.optics.prescription import Lens, with_focus_shift
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.search.joint_states import JointProblem, JointVariable, joint_of
from camkit.models_def.optics.search.problem import Problem, image_scale_mm
from camkit.models_def.optics.search.splat import Pixels
from camkit.models_def.optics.search.variables import FreeLens
from camkit.models_def.optics.trace import surface_tensors
from camkit.models_def.training.first_weights import read_first_weights, take_first_weights
from camkit.models_def.training.kind import read_recipe
from camkit.models_def.training.pictures import SceneSource, open_scenes
from camkit.progress import note
from camkit.units import to_radians


def problem_of(recipe: DesignRecipe, lens: Lens) -> Problem:
    """Return the fields, wavelengths and depths of a recipe, and what is free of a lens."""
    optics = recipe.optics
    lens = with_phases(lens, recipe.phases)
    if optics.object_distances_mm:
        lens = refocused(lens, optics.focus_distance_mm or optics.object_distances_mm[0])
    if optics.f_number:
        lens = replace(lens, aperture_kind="f_number", aperture_value=optics.f_number)
    count, solved = len(lens.surfaces), optics.solved_surface
    if not -count <= solved < count:
        raise ContractError(
            f"optics.solved_surface must be 0..{count - 1} (-1 is the last); got {solved}"
        )
    last = solved % count
    _refuse_steep_bounds(recipe, lens)
    free = FreeLens(
        lens=lens,
        variables=recipe.variables,
        solved=last if optics.efl_mm else None,
        efl_mm=optics.efl_mm or None,
        rides=optics.rides,
    )
    return _problem_at(recipe, free, field_slopes(optics))


def _refuse_steep_bounds(recipe: DesignRecipe, lens: Lens) -> None:
    """Refuse curvatures with which a surface ends within its rim, whatever its conic becomes."""
    conics = {v.surface: v.low for v in recipe.variables if v.kind == "conic"}
    for v in recipe.variables:
        if v.kind != "curvature" or not 0 <= v.surface < len(lens.surfaces):
            continue
        surface = lens.surfaces[v.surface]
        least = 0.0 if v.low <= 0 <= v.high else min(abs(v.low), abs(v.high))
        shape = max(0.0, 1 + min(surface.conic, conics.get(v.surface, surface.conic)))
        rim_mm = surface.semi_diameter_mm
        if math.isfinite(rim_mm) and least * rim_mm * math.sqrt(shape) >= 1:
            raise ContractError(
                f"curvature of surface {v.surface}: {v.low:g} .. {v.high:g} 1/mm cannot reach its "
                f"rim, {rim_mm:g} mm from the axis. A curvature is 1 / radius, in 1/mm: give "
                "vary.low and vary.high so"
            )


def refuse_small_image(recipe: DesignRecipe, problem: Problem) -> None:
    """Refuse fields whose whole image is smaller than one patch with its PSF.

    Raises:
        ContractError: Naming the keys that say how large the image is.
    """
    optics, pixels = recipe.optics, recipe.pixels
    free = problem.free
    reference_um = torch.tensor([free.lens.reference_wavelength_um], dtype=torch.float64)
    reference = free.tensors(free.scaled()[None], reference_um)
    scale_mm = abs(float(image_scale_mm(reference, problem.depths_mm[0])))
    height_mm = scale_mm * float(problem.slopes.max())
    width_px, side_px = (
        2000 * height_mm / pixels.pitch_um,
        recipe.schedule.patch_px + max(0, pixels.kernel_px - 1),
    )
    if width_px < side_px:
        efl_text = f" and efl_mm = {optics.efl_mm:g}" if optics.efl_mm else ""
        raise ContractError(
            f"optics.half_field_deg = {optics.half_field_deg:g} degrees{efl_text} make an image "
            f"{2 * height_mm:.3g} mm wide, {width_px:.3g} px of pixels.pitch_um = "
            f"{pixels.pitch_um:g} um; a patch with its PSF takes {side_px} px. Check the units of "
            "these keys"
        )


def joint_problem_of(recipe: DesignRecipe, lens: Lens) -> JointProblem:
    """Return the problem of a recipe with several configurations of a lens.

    Raises:
        ContractError: If the lens lacks one of them, or a variable is of none.
    """
    choice = recipe.optics.configurations
    names = state_names(lens, ALL if choice == (ALL,) else choice)
    slopes = field_slopes(recipe.optics)
    first_mm = _image_scale_mm(plain_lens(lens, names[0]))

    def problem_at(free: FreeLens) -> Problem:
        return _problem_at(recipe, free, slopes * (first_mm / _image_scale_mm(free.lens)))

    shared = [JointVariable(variable=v) for v in recipe.variables]
    return joint_of(lens, names, [*shared, *recipe.state_variables], problem_at)


def _image_scale_mm(lens: Lens) -> float:
    wave = torch.tensor(lens.reference_wavelength_um, dtype=torch.float64)
    return float(image_scale_mm(surface_tensors(lens, wave), lens.object_distance_mm))


def _problem_at(recipe: DesignRecipe, free: FreeLens, slopes: Tensor) -> Problem:
    optics = recipe.optics
    return Problem(
        free=free,
        slopes=slopes,
        azimuths_rad=field_azimuths(optics),
        wavelengths_um=torch.tensor(recipe.pixels.wavelengths_um, dtype=torch.float64),
        object_distances_mm=optics.object_distances_mm,
        samples=half_disc(optics.pupil_rays),
        core_mm=recipe.pixels.pitch_um / 1000,
        limits=recipe.limits,
    )


def refocused(lens: Lens, distance_mm: float) -> Lens:
    """Return the lens with its sensor moved as the paraxial image of an object at a distance is."""
    unfocused = replace(lens, object_distance_mm=distance_mm)
    return with_focus_shift(
        unfocused, paraxial_image(unfocused).distance_mm - paraxial_image(lens).distance_mm
    )


def field_slopes(optics: OpticsRecipe) -> Tensor:
    """Return the fields (field,) as slopes, spaced as the recipe says.

    With azimuths each slope but that of the axis stands once for each of them.
    """
    edge_slope = math.tan(to_radians(optics.half_field_deg))
    steps = torch.linspace(0, 1, optics.fields, dtype=torch.float64)
    slopes: Tensor = edge_slope * (steps.sqrt() if optics.spacing == "area" else steps)
    times = max(1, len(optics.azimuths_deg))
    return torch.cat([slopes[:1], slopes[1:].repeat_interleave(times)])


def field_azimuths(optics: OpticsRecipe) -> Tensor | None:
    """Return the azimuths (field,) of the fields in radians; None where all lie along +y."""
    if not optics.azimuths_deg:
        return None
    azimuths = torch.deg2rad(torch.tensor(optics.azimuths_deg, dtype=torch.float64))
    return torch.cat([azimuths.new_zeros(1), azimuths.repeat(optics.fields - 1)])


def with_phases(lens: Lens, phases: Sequence[PhaseRecipe]) -> Lens:
    """Return the lens with the phases that a recipe adds to its surfaces.

    Raises:
        ContractError: If there is no such surface, or it has a phase already.
    """
    surfaces = list(lens.surfaces)
    for added in phases:
        if not 0 <= added.surface < len(surfaces) or surfaces[added.surface].phase is not None:
            raise ContractError(
                f"a [[phase]] needs a surface 0..{len(surfaces) - 1} without a phase; got "
                f"{added.surface}"
            )
        surfaces[added.surface] = replace(surfaces[added.surface], phase=added.phase)
    return replace(lens, surfaces=tuple(surfaces))


def pixels_of(recipe: DesignRecipe, *views: tuple[Problem, Tensor]) -> Pixels:
    """Return the pixels and colours of a recipe, with a window that fits a lens.

    Args:
        recipe: The design.
        views: The lens at the start in each of its states: the problem, and (variable,).
    """
    weights = torch.tensor(recipe.pixels.color_weights, dtype=torch.float64)
    pixels = Pixels(
        pitch_um=recipe.pixels.pitch_um,
        kernel_px=recipe.pixels.kernel_px or WIDEST_PX,
        color_weights=weights / weights.sum(1, keepdim=True),
        window_follows=recipe.camera is not None,
    )
    pixels = replace(pixels, regime=_regime(recipe, views, pixels.color_weights))
    if recipe.pixels.kernel_px:
        return pixels
    windows = [fitting_window_px(problem, begin, pixels) for problem, begin in views]
    return replace(pixels, kernel_px=max(windows))


def _regime(
    recipe: DesignRecipe, views: Sequence[tuple[Problem, Tensor]], shares: Tensor
) -> PsfRegime:
    """Return the PSF model of a recipe, and note the reason."""
    regime = checked_regime(recipe.optics.psf_model, "optics.psf_model")
    if any(problem.whole_pupil for problem, _ in views):
        note("PSF by rays: azimuths_deg takes no waves")
        return "rays"
    if regime is not None:
        note(f"PSF by {regime}: optics.psf_model of the recipe")
        return regime
    models = [model for view in views for model in design_models(*view, shares)]
    model = next((model for model in models if model.regime == "waves"), models[0])
    slow = '. Waves may take 50 times as long: optics.psf_model = "rays" is a quick trial'
    note(f"PSF by {model.reason}{slow if model.regime == 'waves' else ''}")
    return model.regime


def recorder_of(recipe: DesignRecipe) -> Recorder:
    """Return the pixel model of a recipe; raises ContractError for unknown colour filters."""
    name, patterns = recipe.pixels.cfa, {str(cfa): cfa for cfa in CFA_PATTERNS}
    if name and name not in patterns:
        raise ContractError(
            f"pixels.cfa must be one of {', '.join(patterns)}, or empty; got {name!r}"
        )
    return Recorder(noise=recipe.pixels.noise, cfa=patterns.get(name))


def network_of(recipe: DesignRecipe) -> nn.Module | None:
    """Build the network of a recipe for the planes of its front; None without one."""
    choice = recipe.network
    if not choice.name:
        return None
    torch.manual_seed(recipe.schedule.seed)
    network = build_network(choice.name, **choice.config)
    check_patch(choice.name, network, recipe.schedule.patch_px)
    planes = recipe.front.channels
    if network.in_channels != planes:
        raise ContractError(
            f"network {choice.name} takes {network.in_channels} planes, the front "
            f"{recipe.front.kind!r} gives {planes}; set network.config.in_channels"
        )
    if choice.start:
        take_first_weights(network, read_first_weights(Path(choice.start), choice.start_size))
    return network


def camera_of(recipe: DesignRecipe, folder: Path | None) -> Camera | None:
    """Return the camera whose bank stands in front; None where it is another front.

    Raises:
        ContractError: If its recipe is missing or of another kind, or its pixels are not those of
            the design.
    """
    choice = recipe.camera
    if choice is None:
        return None
    training = read_recipe((folder or Path()) / choice.recipe)
    if not isinstance(training, BayerRecipe):
        raise ContractError(f"camera.recipe must be of a camera behind a mosaic: {choice.recipe}")
    pitch_um = training.sensor.pixel_pitch_um
    if pitch_um != recipe.pixels.pitch_um:
        raise ContractError(
            f"pixels.pitch_um must be that of {choice.recipe}, {pitch_um}; got "
            f"{recipe.pixels.pitch_um}"
        )
    return Camera(training, choice, recipe.front.margin_px)


def parts_of(
    recipe: DesignRecipe,
    *,
    folder: Path | None = None,
    pictures: Path | None = None,
    source: SceneSource | None = None,
    start: str = "",
) -> DesignParts:
    """Return the parts of a loop; a lens that is to stay (`lens_rate` 0) is not searched for.

    Args:
        recipe: The design.
        folder: Of the recipe, for relative paths.
        pictures: Folder of sharp pictures; None for procedural scenes alone.
        source: Of sharp patches, already open, in the place of `pictures`.
        start: Name of the built-in lens that an earlier search of the library chose: the design
            begins at it, without a search. Empty for the lens of the recipe.
    """
    source, camera = source or source_of(recipe, pictures), camera_of(recipe, folder)

    def parts_at(lens: DesignLens, network: nn.Module | None) -> DesignParts:
        return DesignParts(
            lens=lens,
            network=network,
            front=recipe.front,
            recorder=recorder_of(recipe),
            fabrication=recipe.fabrication,
            loss=recipe.loss,
            source=source,
            camera=camera,
        )

    if recipe.optics.configurations:
        states = find_lens(recipe.prescription, folder, with_states=True)
        return parts_at(_states_module(recipe, states), network_of(recipe))
    problem = problem_of(recipe, find_lens(recipe.prescription, folder))
    refuse_small_image(recipe, problem)
    plan = recipe.starts if recipe.schedule.lens_rate else Starts()
    shipped = [library_start(problem, start)] if start else []
    starts = shipped or found_starts(problem, plan)
    pixels = pixels_of(recipe, (starts[0].problem, starts[0].scaled))

    def module(start: Start, scaled: Tensor, *, whiten: bool) -> LensModule:
        return LensModule(start.problem, pixels, scaled, whiten=whiten, units=recipe.optics.units)

    def judge(start: Start) -> float:
        parts = parts_at(module(start, start.scaled, whiten=False), None)
        loop = DesignLoop(parts, recipe.schedule)
        loop.judge()
        return loop.best_merit

    best = best_judged(starts, judge)
    begin = best.scaled
    if recipe.descent and recipe.fabrication and camera and recipe.schedule.lens_rate:
        descending = Descending(
            descent=recipe.descent,
            camera=camera,
            fabrication=recipe.fabrication,
            make=lambda scaled: LensModule(best.problem, pixels, scaled),
            seed=recipe.schedule.seed,
        )
        begin = descended(begin, descending)
    lens = module(best, begin, whiten=recipe.optics.whiten)
    return replace(parts_at(lens, network_of(recipe)), start=best.name)


def _states_module(recipe: DesignRecipe, lens: Lens) -> StatesModule:
    """Return the lens of a recipe with several configurations, as it begins."""
    joint = joint_problem_of(recipe, lens)
    begin = joint.scaled()
    pixels = pixels_of(recipe, *((term.problem, begin[term.places]) for term in joint.terms))
    optics = recipe.optics
    return StatesModule(joint, pixels, begin, whiten=optics.whiten, units=optics.units)


def source_of(recipe: DesignRecipe, pictures: Path | None) -> SceneSource:
    """Open the pictures of a folder and the procedural scenes of a recipe."""
    return open_scenes(recipe.data, pictures)
