"""`camkit freeze --unit`: captures of a target to the facts about the camera body that took them.

OPTICS a bundle: its kernels, of its nominal and its moved sensor
OPTICS a lens:   traced with the sensor moved (needs torch)
  -> edges of the captures held against both -> focus -> UNIT.toml
"""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from camkit.errors import ContractError, UnsupportedError
from camkit.progress import working

if TYPE_CHECKING:
    from camkit.calibration.focus import EdgeCamera
    from camkit.models_def.optics.optics import Optics

AUTO: Final = "auto"
STEPS: Final = (-1.0, -0.5, 0.5, 1.0)
"""Of the range, where the kernels of a lens are traced to measure with."""
LEAST_ENERGY: Final = 0.9
UNIT_SUFFIX: Final = ".toml"


@working("measuring the focus of a camera body")
def measure_unit(
    optics: Path,
    captures: list[Path],
    out: Path,
    recipe: Path,
    depths_mm: tuple[float, ...],
    focus_um: str | None,
) -> dict[str, Any]:
    """Measure a camera body and write its file; return the measured focus.

    Raises:
        ContractError: If there is no capture, the names are wrong, or nothing can be measured.
    """
    if out.suffix.lower() != UNIT_SUFFIX:
        raise ContractError(f"a camera body is TOML; expected a name in {UNIT_SUFFIX}, got {out}")
    if not captures:
        raise ContractError("--unit needs captures of a target: camkit freeze OPTICS --unit FILES")
    if len(depths_mm) > 1:
        raise ContractError("the target lies at one distance: give one with --depths-mm")
    from camkit.bundle.reader import SUFFIX
    from camkit.calibration.focus import measure_focus
    from camkit.runtime.output.part_file import atomic_output
    from camkit.runtime.raw import read_capture
    from camkit.runtime.unit import format_unit

    if optics.suffix.lower() == SUFFIX:
        if focus_um is not None:
            raise ContractError("a bundle holds its kernels already; leave --focus-um out")
        camera, identity = _of_bundle(optics, depths_mm)
    else:
        camera, identity = _of_lens(optics, recipe, depths_mm, focus_um)
    focus = measure_focus([(path.name, read_capture(path)) for path in captures], camera)
    facts = focus.to_json()
    out.parent.mkdir(parents=True, exist_ok=True)
    with atomic_output(out) as part:
        part.write_text(format_unit(out.stem, identity, facts), encoding="utf-8")
    return {**facts, "out": str(out)}


def focus_range_um(optics: "Optics", text: str | None) -> float:
    """Read --focus-um: a number > 0, or `auto` for the range of a lens's copies; 0 for none.

    Raises:
        ContractError: If it is neither.
        UnsupportedError: If the optics are no lens, whose copies are known.
    """
    if text is None:
        return 0.0
    if text == AUTO:
        from camkit.models_def.optics.lens_optics import LensOptics

        if not isinstance(optics, LensOptics):
            raise UnsupportedError(
                "auto needs a lens, whose fabricated samples differ in focus; give a number in um"
            )
        return optics.focus_range_um()
    try:
        range_um = float(text)
    except ValueError:
        range_um = math.nan
    if not 0 < range_um < math.inf:
        raise ContractError(f"--focus-um takes a number > 0 or {AUTO}; got {text!r}")
    return range_um


def _of_bundle(path: Path, depths_mm: tuple[float, ...]) -> "tuple[EdgeCamera, dict[str, str]]":
    """Return the camera of a bundle, and its name in a unit file: that of its lens where stated."""
    from camkit.bundle.reader import PRESCRIPTION, open_bundle
    from camkit.calibration.focus import EdgeCamera
    from camkit.runtime.unit import lens_hash

    bundle = open_bundle(path)
    sensor = bundle.manifest.sensor
    if sensor.type == "spad":
        raise UnsupportedError("a sensor that counts photons has no edges to measure a focus on")
    depth_mm = depths_mm[0] if depths_mm else bundle.reference_depth_mm
    camera = EdgeCamera(psf=bundle.psf, sensor=sensor, depth_mm=depth_mm)
    if PRESCRIPTION in bundle.names:
        return camera, {"lens_sha256": lens_hash(bundle.member(PRESCRIPTION))}
    return camera, {"bundle_sha256": bundle.sha256}


def _of_lens(
    path: Path, recipe: Path, depths_mm: tuple[float, ...], focus_um: str | None
) -> "tuple[EdgeCamera, dict[str, str]]":
    """Trace a lens with its sensor moved, for the sensor of a recipe."""
    from camkit.cli.design.design_time import require_torch

    require_torch("camkit freeze")
    from camkit.bundle.sensor import ColorSensor
    from camkit.calibration.focus import EdgeCamera
    from camkit.models_def.optics.frozen import FreezeGrid, freeze, with_focus
    from camkit.models_def.optics.lens_optics import LensOptics
    from camkit.models_def.optics.optics_file import read_optics
    from camkit.models_def.optics.prescription import format_prescription
    from camkit.models_def.training.kind import read_recipe
    from camkit.runtime.unit import lens_hash

    lens = read_optics(path)
    if not isinstance(lens, LensOptics):
        raise UnsupportedError(
            f"a camera body is measured with a lens or a bundle; {path.name} is neither"
        )
    sensor = read_recipe(recipe).sensor
    if not isinstance(sensor, ColorSensor):
        raise UnsupportedError(f"a {sensor.type} sensor has no edges to measure a focus on")
    range_um = focus_range_um(lens, AUTO if focus_um is None else focus_um)
    grid = FreezeGrid(depths_mm=depths_mm, least_energy=LEAST_ENERGY)
    shifts_um = tuple(step * range_um for step in STEPS)
    psf, _ = with_focus(freeze(lens, sensor, grid).psf, shifts_um, lens.refocused, sensor)
    identity = {"lens_sha256": lens_hash(format_prescription(lens.lens).encode())}
    return EdgeCamera(psf=psf, sensor=sensor), identity
