"""Captures of a target to the facts about the camera body that took them.

optics a bundle: its kernels, of its nominal and its moved sensor
optics a lens:   traced with the sensor moved (needs torch)
  -> edges of the captures compared with both -> focus -> the body's TOML
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from camkit.bundle.reader import PRESCRIPTION, SUFFIX, open_bundle
from camkit.bundle.sensor import ColorSensor
from camkit.calibrate.result_files import paths_of
from camkit.calibration.focus import EdgeCamera, MeasuredFocus, measure_focus
from camkit.caller import command_text, option_text
from camkit.errors import ContractError, UnsupportedError
from camkit.field_types import checked
from camkit.models_def.face.optics_freezing import AUTO, default_recipe, focus_range_um
from camkit.models_def.face.torch_need import require_torch
from camkit.progress import working
from camkit.runtime.files.in_memory import FilePath
from camkit.runtime.output.part_file import atomic_output, refuse_existing
from camkit.runtime.raw import read_capture
from camkit.runtime.unit import format_unit, lens_hash

STEPS: Final = (-1.0, -0.5, 0.5, 1.0)
"""Of the range, where the kernels of a lens are traced to measure with."""
LEAST_ENERGY: Final = 0.9
UNIT_SUFFIX: Final = ".toml"


@checked
@working("measuring the focus of a camera body")
def camera_body(
    optics: FilePath,
    captures: FilePath | Sequence[FilePath],
    out: FilePath,
    *,
    recipe: FilePath | None = None,
    depths_mm: Sequence[float] = (),
    focus_um: float | str | None = None,
    overwrite: bool = False,
) -> MeasuredFocus:
    """Measure the focus of a camera body and write its file, for `unit` of `camkit.load`.

    Args:
        optics: Bundle with kernels of a moved sensor, or lens (.toml, .zmx; needs torch).
        captures: Captures of dark squares on white, by this body.
        out: Camera body to write (.toml).
        recipe: Recipe (.toml) with the sensor, for a lens; None for duet's.
        depths_mm: Distance of the target, one at most; empty for that of the optics.
        focus_um: For a lens: the largest shift of the sensor, or "auto" (the default).
        overwrite: Whether a file that exists is replaced.

    Raises:
        ContractError: If there is no capture, an option is wrong, or nothing can be measured.
        UnsupportedError: If the optics are neither, or torch is needed and not installed.
    """
    file = Path(out)
    refuse_existing([file], overwrite=overwrite)
    if file.suffix.lower() != UNIT_SUFFIX:
        raise ContractError(f"a camera body is TOML; expected a name in {UNIT_SUFFIX}, got {file}")
    paths = paths_of(captures)
    if not paths:
        raise ContractError("a camera body needs captures of a target: name them after the optics")
    if len(depths_mm) > 1:
        raise ContractError(
            f"the target lies at one distance: give one with {option_text('depths_mm')}"
        )
    if Path(optics).suffix.lower() == SUFFIX:
        if focus_um is not None:
            raise ContractError(
                f"a bundle holds its kernels already; leave {option_text('focus_um')} out"
            )
        camera, identity = _of_bundle(Path(optics), depths_mm)
    else:
        plan = default_recipe() if recipe is None else Path(recipe)
        camera, identity = _of_lens(Path(optics), plan, depths_mm, focus_um)
    focus = measure_focus([(path.name, read_capture(path)) for path in paths], camera)
    file.parent.mkdir(parents=True, exist_ok=True)
    with atomic_output(file) as part:
        part.write_text(format_unit(file.stem, identity, focus.to_json()), encoding="utf-8")
    return focus


def _of_bundle(path: Path, depths_mm: Sequence[float]) -> tuple[EdgeCamera, dict[str, str]]:
    """Return the camera of a bundle, and its name in a unit file: that of its lens where stated."""
    bundle = open_bundle(path)
    sensor = bundle.manifest.light_sensor
    depth_mm = depths_mm[0] if depths_mm else bundle.reference_depth_mm
    camera = EdgeCamera(psf=bundle.psf, sensor=sensor, depth_mm=depth_mm)
    if PRESCRIPTION in bundle.names:
        return camera, {"lens_sha256": lens_hash(bundle.member(PRESCRIPTION))}
    return camera, {"bundle_sha256": bundle.sha256}


def _of_lens(
    path: Path, recipe: Path, depths_mm: Sequence[float], focus_um: float | str | None
) -> tuple[EdgeCamera, dict[str, str]]:
    """Trace a lens with its sensor moved, for the sensor of a recipe."""
    require_torch(command_text("freeze"))
    from camkit.models_def.optics.frozen import FreezeGrid, freeze, with_focus
    from camkit.models_def.optics.lens_optics import LensOptics
    from camkit.models_def.optics.optics_file import read_optics
    from camkit.models_def.optics.prescription import format_prescription
    from camkit.models_def.training.kind import read_recipe

    lens = read_optics(path)
    if not isinstance(lens, LensOptics):
        raise UnsupportedError(
            f"a camera body is measured with a lens or a bundle; {path.name} is neither"
        )
    sensor = read_recipe(recipe).sensor
    if not isinstance(sensor, ColorSensor):
        raise UnsupportedError(f"a {sensor.type} sensor has no edges to measure a focus on")
    lens = lens.by_rule(sensor)
    range_um = focus_range_um(lens, AUTO if focus_um is None else focus_um)
    grid = FreezeGrid(depths_mm=tuple(depths_mm), least_energy=LEAST_ENERGY)
    shifts_um = tuple(step * range_um for step in STEPS)
    psf, _ = with_focus(freeze(lens, sensor, grid).psf, shifts_um, lens.refocused, sensor)
    identity = {"lens_sha256": lens_hash(format_prescription(lens.lens).encode())}
    return EdgeCamera(psf=psf, sensor=sensor), identity
