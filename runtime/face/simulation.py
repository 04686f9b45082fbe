"""The digital twin for programs and the command line: a sharp scene to a capture and its file.

scene -> exposure for a share that saturates -> the camera of the bundle -> capture, truth, facts

A camera that counts photons records the scene by its own options: photons and sbr.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.bundle.sensor import ColorSensor, Sensor
from camkit.caller import option_list, option_text
from camkit.errors import ContractError
from camkit.field_types import checked
from camkit.progress import working
from camkit.runtime.files.in_memory import FilePath, optional_path
from camkit.runtime.files.picture import read_light
from camkit.runtime.kind import RuntimePart, part_of
from camkit.runtime.network.engine import available_threads
from camkit.runtime.output.part_file import refuse_existing
from camkit.runtime.twin.saturation import exposure_for_share, saturation_of
from camkit.runtime.twin.simulate import Simulation, SimulationOptions, bare_psf
from camkit.runtime.twin.truth import ideal_picture, picture_scale, write_truth
from camkit.runtime.unit import Unit, read_unit
from camkit.scenes import is_scene_name, named_scene
from camkit.scenes.saturation import Saturation, with_exposure
from camkit.units import MM_PER_M

DEFAULT_PHOTONS: Final = 1e4
SEED_SCENE_PX: Final = (1024, 512)
"""Scenes of a seed are drawn in this size and fitted to an array that counts photons."""
Scene = FilePath | np.ndarray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SimulatedCapture:
    """The result of `simulate`.

    Attributes:
        samples: (h, w) mosaic or (c, h, w) planes, uint16 DN, black level included; of a camera
            that counts photons its array, such as (t, y, x) counts.
        truth: (3, H, W) float32 linear Rec.709, the picture of a perfect camera; None unless a
            file was asked for.
        facts: Plain JSON values, as `camkit simulate --json` prints them.
    """

    samples: NDArray[Any]
    truth: FloatArray | None = None
    facts: Mapping[str, Any]

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON values."""
        return dict(self.facts)


@checked
def simulate(
    scene: Scene,
    bundle: FilePath,
    out: FilePath | None = None,
    *,
    iso: float | None = None,
    seed: int = 0,
    origin_px: tuple[int, int] | None = None,
    exposure: float | None = None,
    saturate: float | None = None,
    photons: float | None = None,
    sbr: float | None = None,
    surround_px: int = 0,
    bits: int | None = None,
    plate: bool = True,
    depth_m: float | None = None,
    configuration: str | int | None = None,
    unit: Unit | FilePath | None = None,
    size_px: tuple[int, int] | None = None,
    truth: FilePath | None = None,
    overwrite: bool = False,
) -> SimulatedCapture:
    """Simulate a capture of a scene: blur, vignetting, noise and saturation of a camera.

    Args:
        scene: A picture (8 or 16 bits: sRGB; EXR and HDR: linear), the name of a scene such as
            "procedural:7", or (3, h, w) linear Rec.709, >= 0, 1.0 = white. A camera that counts
            photons also takes an NPZ.
        bundle: The camera: name of a built-in bundle, or path.
        out: The capture to write, such as a DNG; None writes none.
        iso: ISO speed; None for 100.
        seed: Seed of the noise.
        origin_px: (x, y) of a crop on the sensor; None centres it.
        exposure: Factor on the scene's radiance; None for 1.
        saturate: Share of the pixels to saturate, in place of `exposure`.
        photons: Photons per pixel of a camera that counts them; None for 10000.
        sbr: Signal to background photons of such a camera; None for no background.
        surround_px: Width of the scene outside the frame that still adds light.
        bits: Bits of the AD converter, 8 to 16; None for the levels of the sensor.
        plate: False for the bare lens of a camera that has a plate.
        depth_m: Object distance; None for the focus.
        configuration: State of a zoom or focusing lens, by name or number; None for the first.
        unit: Camera body whose focus is simulated, or its TOML.
        size_px: (width, height) of the scene, cut from a picture; None for the sensor or the
            whole picture.
        truth: EXR for the picture of a perfect lens and sensor; None writes none.
        overwrite: Whether files that exist are replaced.

    Raises:
        ContractError: If an option is wrong, or means nothing to this camera.
        BundleError: If the bundle is refused.
        DecodeError: If the picture cannot be read.
    """
    if exposure is not None and saturate is not None:
        raise ContractError(
            f"{option_text('saturate')} finds the exposure: leave {option_text('exposure')} out"
        )
    file, truth_file = optional_path(out), optional_path(truth)
    refuse_existing([file, truth_file], overwrite=overwrite)
    opened = open_bundle(find_bundle(str(bundle))).with_configuration(configuration)
    part, sensor = part_of(opened.manifest), opened.manifest.sensor
    _check_suffix(file, part)
    if part.simulation is not None:
        photograph_options = {
            "iso": iso,
            "origin_px": origin_px,
            "exposure": exposure,
            "bits": bits,
            "saturate": saturate,
            "surround_px": surround_px or None,
            "truth": truth,
            "plate": None if plate else False,
            "depth_m": depth_m,
            "unit": unit,
            "size_px": size_px,
        }
        _refuse_options(photograph_options, opened, counts_photons=True)
        light = part.simulation(
            photons=DEFAULT_PHOTONS if photons is None else photons,
            sbr=math.inf if sbr is None else sbr,
            seed=seed,
        )
        return _record(scene, opened, file, light, overwrite=overwrite)
    _refuse_options({"photons": photons, "sbr": sbr}, opened, counts_photons=False)
    _check_bits(bits, sensor)
    _check_truth(truth_file, file, opened)
    if not plate:
        bare_psf(opened)  # refuses cameras without one before a scene is drawn
    options = SimulationOptions(
        iso=100.0 if iso is None else iso,
        seed=seed,
        origin_px=origin_px,
        exposure=1.0 if exposure is None else exposure,
        surround_px=surround_px,
        bits=bits,
        plate=plate,
        depth_mm=_depth_mm(opened) if depth_m is None else depth_m * MM_PER_M,
        focus_um=_focus_um(unit, opened),
        workers=available_threads(None),
    )
    light_map = _scene(scene, size_px, (sensor.width_px, sensor.height_px), surround_px)
    return _photograph(light_map, opened, options, saturate, (file, truth_file))


def _photograph(
    scene: FloatArray,
    bundle: Bundle,
    options: SimulationOptions,
    share: float | None,
    files: tuple[Path | None, Path | None],
) -> SimulatedCapture:
    """Photograph a scene, and write capture and truth where files are named."""
    part, (out, truth) = part_of(bundle.manifest), files
    scene, saturation = _exposed(scene, bundle.manifest.light_sensor, options, share)
    with working("photographing the scene"):
        simulation = part.simulate(scene, bundle, options)
        picture = None if truth is None else ideal_picture(simulation, bundle)
    _write(out, simulation, bundle)
    if truth is not None and picture is not None:
        truth.parent.mkdir(parents=True, exist_ok=True)
        write_truth(truth, picture)
    facts = _facts(out, truth, simulation, saturation)
    return SimulatedCapture(samples=simulation.samples, truth=picture, facts=facts)


def _record(
    scene: Scene, bundle: Bundle, out: Path | None, options: Any, *, overwrite: bool
) -> SimulatedCapture:
    """Record a scene with a camera that counts photons, and write it where a file is named."""
    part = part_of(bundle.manifest)
    files = () if out is None else part.files(out)
    refuse_existing(files, overwrite=overwrite)
    recording = part.simulate(_photon_scene(scene), bundle, options)
    _write(out, recording, bundle)
    facts = {
        "path": None if out is None else str(out),
        "files": [str(file) for file in files],
        "array": recording.name,
        "shape": list(recording.values.shape),
        "photons": options.photons,
        "seed": options.seed,
        "counts": int(recording.values.sum(dtype="int64")),
        "notes": list(recording.notes),
    }
    return SimulatedCapture(samples=recording.values, facts=facts)


def _write(out: Path | None, recording: Any, bundle: Bundle) -> None:
    if out is not None:
        out.parent.mkdir(parents=True, exist_ok=True)
        part_of(bundle.manifest).write(out, recording, bundle)


def _refuse_options(options: Mapping[str, object], bundle: Bundle, *, counts_photons: bool) -> None:
    """Refuse options of the other sort of cameras.

    Raises:
        ContractError: Names them.
    """
    names = [name for name, value in options.items() if value is not None]
    if not names:
        return
    words = option_list(names).replace(option_text("plate"), option_text("plate", value=False))
    refusal = f"{words} does not apply to bundle {bundle.manifest.name}"
    if counts_photons:
        raise ContractError(
            f"{refusal}, which counts photons: use {option_list(['photons', 'sbr'])} and "
            f"{option_text('seed')}"
        )
    raise ContractError(
        f"{refusal}: its camera counts no photons; use {option_text('exposure')} and "
        f"{option_text('iso')}"
    )


def _check_suffix(out: Path | None, part: RuntimePart) -> None:
    if out is not None and out.suffix.lower() not in part.suffixes:
        raise ContractError(
            f"a simulated capture of this camera is a file in {', '.join(part.suffixes)}; got {out}"
        )


def _check_bits(bits: int | None, sensor: Sensor) -> None:
    if bits is None:
        return
    if not 8 <= bits <= 16:
        raise ContractError(f"{option_text('bits')} takes 8 to 16; got {bits}")
    if sensor.type != "bayer":
        raise ContractError(
            f"{option_text('bits')} is for cameras with a mosaic, whose DNG states its levels"
        )


def _check_truth(truth: Path | None, out: Path | None, bundle: Bundle) -> None:
    """Refuse a truth that could not be written, before anything is."""
    if truth is None:
        return
    if truth.suffix.lower() != ".exr":
        raise ContractError(f"the truth is an EXR; expected a name in .exr, got {truth}")
    if out is not None and truth.resolve() == out.resolve():
        raise ContractError(f"capture and truth need different names; got {truth} twice")
    scale = picture_scale(bundle.manifest)
    if scale != 1:
        raise ContractError(
            f"{option_text('truth')} needs a camera whose pictures are as fine as its sensor; "
            f"{bundle.path.name} makes them {scale} times finer"
        )


def _exposed(
    scene: FloatArray, sensor: ColorSensor, options: SimulationOptions, share: float | None
) -> tuple[FloatArray, Saturation | None]:
    """Return the scene with its exposure, and the share of its picture that saturates."""
    inner = slice(options.surround_px, -options.surround_px or None)
    frame = scene[:, inner, inner]
    if share is None:
        return scene, saturation_of(frame, sensor, options.exposure)
    saturation = exposure_for_share(frame, sensor, share)
    return with_exposure(scene, saturation.exposure), saturation


def _facts(
    out: Path | None, truth: Path | None, simulation: Simulation, saturation: Saturation | None
) -> dict[str, Any]:
    height, width = simulation.samples.shape[-2:]
    facts = {
        "path": None if out is None else str(out),
        "truth": None if truth is None else str(truth),
        "size": [width, height],
        "iso": simulation.iso,
        "object_distance_m": _metres(simulation.depth_mm),
    }
    names = ("exposure", "saturated_fraction", "peak")
    return facts | {name: saturation and getattr(saturation, name) for name in names}


def _metres(depth_mm: float | None) -> float | str | None:
    """Return a distance as JSON can hold it, which has no infinity."""
    if depth_mm is None or math.isfinite(depth_mm):
        return depth_mm and depth_mm / MM_PER_M
    return "inf"


def _depth_mm(bundle: Bundle) -> float | None:
    """Return the distance of focus; None for a camera that states no optics."""
    return None if bundle.manifest.optics is None else bundle.reference_depth_mm


def _focus_um(unit: Unit | FilePath | None, bundle: Bundle) -> float:
    """Return the focus of a body, which must be one of the bundle's camera."""
    if unit is None:
        return 0.0
    body = unit if isinstance(unit, Unit) else read_unit(Path(unit))
    body.check(bundle)
    return body.focus_um


def _photon_scene(scene: Scene) -> FloatArray | Path:
    """Return a scene for a camera that counts photons: light, or the file of a scene."""
    if isinstance(scene, np.ndarray):
        return scene
    if is_scene_name(str(scene)):
        return named_scene(str(scene), SEED_SCENE_PX[1], SEED_SCENE_PX[0])
    path = Path(scene)
    return path if path.suffix.lower() == ".npz" else read_light(path)


@working("reading or drawing the scene")
def _scene(
    scene: Scene, size_px: tuple[int, int] | None, sensor_px: tuple[int, int], surround_px: int
) -> FloatArray:
    """Draw or read a scene with its surround.

    Raises:
        ContractError: If a picture is smaller than what is to be cut from it.
    """
    size = sensor_px if size_px is None else size_px
    if min(size) < 1:
        raise ContractError(
            f"{option_text('size_px')} takes two numbers >= 1; got {size[0]},{size[1]}"
        )
    if surround_px < 0:
        raise ContractError(f"{option_text('surround_px')} must be >= 0; got {surround_px}")
    width, height = (side + 2 * surround_px for side in size)
    if not isinstance(scene, np.ndarray) and is_scene_name(str(scene)):
        return named_scene(str(scene), height, width)
    light = scene if isinstance(scene, np.ndarray) else read_light(Path(scene))
    if size_px is None:
        return light
    rows, columns = light.shape[-2:]
    if width > columns or height > rows:
        name = "the scene" if isinstance(scene, np.ndarray) else scene
        size_text = option_text("size_px", tuple(size_px))
        ring = f" with a ring of {surround_px} px" if surround_px else ""
        raise ContractError(
            f"{name} has {columns}x{rows} pixels; {size_text}{ring} needs {width}x{height}: take "
            "a smaller size, or leave it out"
        )
    top, left = (rows - height) // 2, (columns - width) // 2
    return light[:, top : top + height, left : left + width]
