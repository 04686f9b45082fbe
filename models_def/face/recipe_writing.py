"""A lens and a sensor to a recipe: `camkit.recipe` and `camkit recipe`."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from camkit.bundle.sensor import RGB
from camkit.caller import command_text, option_text
from camkit.errors import ContractError, UnsupportedError
from camkit.field_types import check_fields, checked
from camkit.models_def.face.torch_need import require_torch
from camkit.runtime.files.in_memory import FilePath
from camkit.runtime.output.part_file import atomic_output, refuse_existing
from camkit.units import MM_PER_M

if TYPE_CHECKING:
    from camkit.models_def.kinds.bayer.recipe_draft import RecipeDraft
    from camkit.models_def.optics.prescription import Lens
    from camkit.models_def.sensors.sensor_choice import SensorChoice

LENS_SUFFIX: Final = "-lens.toml"
PSF_SUFFIX: Final = "-psf.safetensors"
OF_A_LENS: Final = (
    "f_number",
    "stop_radius_mm",
    "focus_m",
    "object_m",
    "defocus_mm",
    "glass",
    "catalogue",
    "configuration",
)
"""Words that a measured PSF answers by itself."""
FIELD_SHARES: Final = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Of the way to the corner of the sensor: what a lens is focused for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraWords:
    """A camera as people describe it.

    Attributes:
        sensor: WIDTHxHEIGHT@PITCHum or a name, with :BGGR, :planes or :grey; None where a
            photograph shows it.
        photo: A RAW file of the camera, whose sensor is taken, or a developed picture.
        pitch_um: Pixel pitch, where the photograph does not state it.
        f_number: EFL / entrance pupil diameter; None for that of the lens file.
        stop_radius_mm: Of the stop, in place of an F-number.
        focus_m: Distance that the lens is focused on, inf for infinity, in metres; None leaves the
            sensor where the file has it.
        object_m: Distances of the scene; empty for the focus.
        distance_from: What distances count from: vertex (the first surface), sensor or pupil.
        defocus_mm: By which the sensor lies behind its place in focus, as
            `camkit calibrate distance` finds it.
        glass: Catalogues (.agf), and `names` or `numbers`; see `read_noted_lens`.
        catalogue: Catalogues of camkit that are asked first, such as schott,hikari.
        configuration: State of a zoom or focusing lens, by name or number; None for the usual one.
    """

    sensor: str | None = None
    photo: FilePath | None = None
    pitch_um: float | None = None
    f_number: float | None = None
    stop_radius_mm: float | None = None
    focus_m: float | None = None
    object_m: Sequence[float] = ()
    distance_from: str = "vertex"
    defocus_mm: float = 0.0
    glass: Sequence[FilePath] = ()
    catalogue: str | None = None
    configuration: str | int | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        if (self.sensor is None) == (self.photo is None):
            raise ContractError(
                f"give {option_text('sensor')}, such as 6000x4000@3.9um, or a photograph by "
                f"{option_text('photo')}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class DescribedCamera:
    """A camera whose lens was read, stopped and focused, or whose PSF was measured.

    Attributes:
        lens: As it is used; None for a measured PSF.
        measured: File of the measured PSF; None for a lens.
        is_grid: Whether its kernels are those of a grid, in place of heights.
        draft: What its recipe is made of.
        notes: For people: how glasses were read, what of a file was left out.
    """

    draft: "RecipeDraft"
    notes: tuple[str, ...] = ()
    lens: "Lens | None" = None
    measured: Path | None = None
    is_grid: bool = False

    def facts(self) -> dict[str, Any]:
        """Return what is known of the camera, plain JSON values."""
        sensor = self.draft.sensor
        return {
            "name": self.draft.name,
            **({} if self.lens is None else first_order(self.lens)),
            "focus_mm": self.draft.focus_mm,
            "objects_mm": list(self.draft.objects_mm),
            "channels": len(sensor.table.get("channels", RGB)),
            "is_grid": self.is_grid,
            "sensor": {k: sensor.table[k] for k in ("width_px", "height_px", "pixel_pitch_um")},
            "defaults": [k for k, source in sensor.sources.items() if source.startswith("default")],
            "notes": list(self.notes),
        }


@checked
def recipe(
    lens: FilePath,
    out: FilePath,
    *,
    camera: CameraWords,
    name: str | None = None,
    overwrite: bool = False,
) -> dict[str, Any]:
    """Write the training recipe of a lens before a sensor, every key with its default.

    The lens as it is used, stopped and focused, is written beside it: NAME-lens.toml; a measured
    PSF as NAME-psf.safetensors.

    Args:
        lens: Lens file (.toml, .zmx), the name of a built-in one, or a measured PSF (.safetensors).
        out: Recipe to write (.toml).
        camera: Its sensor and how the lens is used.
        name: Of the camera; None for that of the recipe's file.
        overwrite: Whether files that exist are replaced.

    Returns:
        The files, and what the camera is.

    Raises:
        ContractError: If the lens or a word is wrong, or a file exists.
        UnsupportedError: If torch is not installed, the lens is a plate, or it holds what camkit
            does not trace.
    """
    path = Path(out)
    suffix = PSF_SUFFIX if is_measured(Path(lens)) else LENS_SUFFIX
    lens_path = path.with_name(path.stem + suffix)
    refuse_existing((path, lens_path), overwrite=overwrite)
    require_torch(command_text("recipe"))
    described = describe_camera(Path(lens), camera, name or path.stem, lens_path.name)
    write_camera(described, path, lens_path)
    return {"recipe": str(path), "lens": str(lens_path), **described.facts()}


def is_measured(optics: Path) -> bool:
    """Return whether optics are a measured PSF, by the name of their file."""
    return optics.suffix.lower() == ".safetensors"


def first_order(lens: "Lens") -> dict[str, float]:
    """Return focal length and F-number."""
    from camkit.models_def.optics.paraxial import paraxial_data

    data = paraxial_data(lens)
    return {"efl_mm": round(data.efl_mm, 4), "f_number": round(abs(data.f_number), 3)}


def describe_camera(
    optics: Path, camera: CameraWords, name: str, optics_name: str
) -> DescribedCamera:
    """Read a lens, stop and focus it, or read a measured PSF, and find its sensor.

    Args:
        optics: File or name.
        camera: Sensor and use.
        name: Of the camera.
        optics_name: Path that the recipe will have for the lens or PSF.
    """
    from camkit.models_def.sensors.sensor_choice import choose_sensor, sensor_of

    if camera.photo is not None:
        from camkit.runtime.raw import read_capture

        sensor = sensor_of(read_capture(camera.photo), camera.pitch_um)
    else:
        sensor = choose_sensor(camera.sensor or "")
    if is_measured(optics):
        return _measured_camera(optics, camera, name, (optics_name, sensor))
    return _lens_camera(optics, camera, name, (optics_name, sensor))


def _measured_camera(
    optics: Path, camera: CameraWords, name: str, place: "tuple[str, SensorChoice]"
) -> DescribedCamera:
    from camkit.calibration.psf_import.own_colours import is_of_own_colours
    from camkit.models_def.kinds.bayer.recipe_draft import RecipeDraft
    from camkit.models_def.optics.measured import read_measured

    useless = [word for word in OF_A_LENS if getattr(camera, word) not in (None, (), 0.0)]
    if useless:
        raise ContractError(
            f"{optics.name} is a measured PSF, stopped and focused as it was measured: leave "
            f"{', '.join(map(option_text, useless))} out"
        )
    if not optics.is_file():
        raise ContractError(f"there is no {optics}; make it by {command_text('psf import')}")
    measured = read_measured(optics)
    draft = RecipeDraft(
        name=name,
        sensor=place[1],
        optics=place[0],
        is_measured=True,
        is_own_colours=is_of_own_colours(measured.wavelengths_um),
        focus_mm=measured.focus_mm,
        objects_mm=measured.depths_mm,
    )
    return DescribedCamera(draft=draft, measured=optics, is_grid=measured.psf.symmetry == "grid")


def _lens_camera(
    lens: Path, camera: CameraWords, name: str, place: "tuple[str, SensorChoice]"
) -> DescribedCamera:
    from camkit.models_def.face.lens_checks import aperture_notes, check_image_circle
    from camkit.models_def.kinds.bayer.recipe_draft import RecipeDraft
    from camkit.models_def.optics.diffraction.plate import is_plate
    from camkit.models_def.optics.lens_file.lens_file import read_noted_lens
    from camkit.models_def.optics.lens_file.placing import Placement, placed_lens

    if is_plate(lens):
        raise UnsupportedError(
            f"{lens.name} is a diffractive plate: its camera is of another kind and has a recipe "
            "of its own (docs/guides/plates.md); lenses and measured PSFs are taken here"
        )
    placement = Placement(
        f_number=camera.f_number,
        stop_radius_mm=camera.stop_radius_mm,
        focus_mm=None if camera.focus_m is None else camera.focus_m * MM_PER_M,
        objects_mm=tuple(value * MM_PER_M for value in camera.object_m),
        origin=camera.distance_from,  # type: ignore[arg-type]
        defocus_mm=camera.defocus_mm,
    )
    glass = tuple(map(str, camera.glass))
    design, notes = read_noted_lens(lens, glass, camera.catalogue, camera.configuration)
    if any(surface.grooves is not None for surface in design.surfaces):
        raise UnsupportedError(
            f"{lens.name} has grooves, which throw a haze over the picture: its camera has a "
            "recipe of its own with [haze] (docs/guides/thin-plate.md)"
        )
    use = placed_lens(with_fields_of(design, place[1]), placement)
    check_image_circle(use, place[1], lens.name)
    draft = RecipeDraft(
        name=name,
        sensor=place[1],
        optics=place[0],
        focus_mm=use.lens.object_distance_mm,
        objects_mm=use.objects_mm,
    )
    notes = (*notes, *aperture_notes(design, use.lens))
    return DescribedCamera(draft=draft, notes=notes, lens=use.lens)


def with_fields_of(lens: "Lens", sensor: "SensorChoice") -> "Lens":
    """Return a lens whose fields are those of a sensor: the axis to the corner, in five steps."""
    from camkit.models_def.optics.paraxial import paraxial_data

    efl_mm = abs(paraxial_data(lens).efl_mm)
    angles = (math.atan(share * sensor.corner_mm / efl_mm) for share in FIELD_SHARES)
    return replace(lens, field_angles_rad=tuple(angles))


def write_camera(camera: DescribedCamera, recipe_path: Path, optics_path: Path) -> None:
    """Write the recipe of a camera, and its lens or PSF."""
    from camkit.models_def.kinds.bayer.recipe_draft import recipe_text
    from camkit.models_def.optics.prescription import format_prescription

    recipe_path.parent.mkdir(parents=True, exist_ok=True)
    if camera.lens is not None:
        optics = format_prescription(camera.lens).encode()
    else:
        optics = Path(camera.measured or "").read_bytes()
    for path, data in ((optics_path, optics), (recipe_path, recipe_text(camera.draft).encode())):
        with atomic_output(path) as part:
            part.write_bytes(data)
