"""`camkit simulate`: the digital twin, a sharp scene to a capture such as a Bayer DNG."""

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from camkit.cli.choices import Debug, DepthM, Json, Overwrite, whole_pair
from camkit.cli.say import say
from camkit.errors import ContractError
from camkit.progress import working
from camkit.units import MM_PER_M

if TYPE_CHECKING:
    from camkit.bundle.reader import Bundle
    from camkit.bundle.sensor import Sensor
    from camkit.contracts import FloatArray
    from camkit.runtime.twin.simulate import Simulation, SimulationOptions
    from camkit.scenes.saturation import Saturation


def simulate(
    scene: Annotated[
        str,
        typer.Argument(
            help="Picture (sRGB, EXR or HDR), procedural:SEED, night:SEED, squares:SEED; SPAD: "
            "also NPZ."
        ),
    ],
    bundle: Annotated[str, typer.Option(help="Camera bundle, NAME or PATH.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Capture to write, such as a DNG.")],
    iso: Annotated[
        float | None, typer.Option(help="ISO speed of the capture; default: 100.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Random seed of the noise.")] = 0,
    origin_px: Annotated[
        str | None,
        typer.Option(help="Position X,Y of a crop on the sensor in px; default: centred."),
    ] = None,
    exposure: Annotated[
        float | None, typer.Option(help="Factor on the scene's radiance; default: 1.")
    ] = None,
    saturate: Annotated[
        float | None,
        typer.Option(help="Share of pixels to saturate, such as 0.015; replaces --exposure."),
    ] = None,
    photons: Annotated[
        float | None,
        typer.Option(
            help="SPAD: photons per pixel (counts: at white; histograms: mean); default: 10000."
        ),
    ] = None,
    sbr: Annotated[
        float | None,
        typer.Option(help="SPAD: ratio of signal to background photons; default: no background."),
    ] = None,
    surround_px: Annotated[
        int,
        typer.Option(
            min=0, help="Width in px of the scene outside the frame that still adds light."
        ),
    ] = 0,
    bits: Annotated[
        int | None,
        typer.Option(help="Bits of the AD converter, 8 to 16; default: the sensor's levels."),
    ] = None,
    no_plate: Annotated[
        bool,
        typer.Option("--no-plate", help="Simulate the bare lens of a camera that has a plate."),
    ] = False,
    depth_m: DepthM = None,
    unit: Annotated[
        Path | None, typer.Option(help="Measured camera body (.toml) whose focus is simulated.")
    ] = None,
    size_px: Annotated[
        str | None,
        typer.Option(
            help="Scene size W,H in px, cropped from a picture; default: the sensor or the "
            "whole picture."
        ),
    ] = None,
    truth: Annotated[
        Path | None,
        typer.Option(help="Also write the ideal picture of a perfect lens and sensor (.exr)."),
    ] = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Simulate a capture of a scene: blur, vignetting, noise and saturation of the camera.

    A picture of 8 or 16 bits is sRGB, EXR and Radiance HDR are linear. A camera that counts photons
    also takes an NPZ with depth_m and albedo, or with transient.
    """
    from camkit.bundle.reader import find_bundle, open_bundle
    from camkit.cli.use.recorded import light_of, simulate_recorded
    from camkit.runtime.kind import part_of
    from camkit.runtime.network.engine import available_threads
    from camkit.runtime.twin.simulate import SimulationOptions, bare_psf
    from camkit.runtime.twin.truth import ideal_picture, write_truth

    if exposure is not None and saturate is not None:
        raise ContractError("--saturate finds the exposure: leave --exposure out")
    for path in filter(None, (out, truth)):
        if path.exists() and not overwrite:
            raise ContractError(f"{path} exists; add --overwrite or choose another name")
    opened = open_bundle(find_bundle(bundle))
    part, sensor = part_of(opened.manifest), opened.manifest.sensor
    counted = light_of(photons, sbr, seed, opened)
    if counted is not None:
        flags = {
            "--iso": iso,
            "--origin-px": origin_px,
            "--exposure": exposure,
            "--bits": bits,
            "--saturate": saturate,
            "--surround-px": surround_px or None,
            "--truth": truth,
            "--no-plate": no_plate,
            "--depth-m": depth_m,
            "--unit": unit,
            "--size-px": size_px,
        }
        simulate_recorded(scene, opened, out, counted, flags, overwrite=overwrite, json_=json_)
        return
    if out.suffix.lower() != part.suffix:
        raise ContractError(
            f"a simulated capture of this camera is a {part.suffix[1:].upper()}; expected a name "
            f"in {part.suffix}, got {out}"
        )
    _check_bits(bits, sensor)
    _check_truth(truth, out, opened)
    if no_plate:
        bare_psf(opened)  # refuses cameras without one before a scene is drawn
    whole = (sensor.width_px, sensor.height_px)
    size = whole if size_px is None else whole_pair(size_px, "--size-px")
    options = SimulationOptions(
        iso=100.0 if iso is None else iso,
        seed=seed,
        origin_px=None if origin_px is None else whole_pair(origin_px, "--origin-px"),
        exposure=1.0 if exposure is None else exposure,
        surround_px=surround_px,
        bits=bits,
        plate=not no_plate,
        depth_mm=_depth_mm(opened) if depth_m is None else depth_m * MM_PER_M,
        focus_um=_focus_um(unit, opened),
        workers=available_threads(None),
    )
    picture = _scene(scene, size, surround_px, is_cut=size_px is not None)
    picture, saturation = _exposed(picture, sensor, options, saturate)
    with working(f"photographing {scene}"):
        simulation = part.simulate(picture, opened, options)
        ideal = None if truth is None else ideal_picture(simulation, opened)
    out.parent.mkdir(parents=True, exist_ok=True)
    part.write(out, simulation, opened)
    if truth is not None and ideal is not None:
        truth.parent.mkdir(parents=True, exist_ok=True)
        write_truth(truth, ideal)
    if json_:
        say(json.dumps(_facts(out, truth, simulation, saturation), allow_nan=False))
    else:
        say(_line(out, simulation, None if saturate is None else saturation))


def _check_bits(bits: int | None, sensor: "Sensor") -> None:
    if bits is None:
        return
    if not 8 <= bits <= 16:
        raise ContractError(f"--bits takes 8 to 16; got {bits}")
    if sensor.type != "bayer":
        raise ContractError("--bits is for cameras with a mosaic, whose DNG states its levels")


def _check_truth(truth: Path | None, out: Path, bundle: "Bundle") -> None:
    """Refuse a truth that could not be written, before anything is."""
    if truth is None:
        return
    from camkit.runtime.twin.truth import picture_scale

    if truth.suffix.lower() != ".exr":
        raise ContractError(f"the truth is an EXR; expected a name in .exr, got {truth}")
    if truth.resolve() == out.resolve():
        raise ContractError(f"capture and truth need different names; got {truth} twice")
    scale = picture_scale(bundle.manifest)
    if scale != 1:
        raise ContractError(
            f"--truth needs a camera whose pictures are as fine as its sensor; {bundle.path.name} "
            f"makes them {scale} times finer"
        )


def _exposed(
    scene: "FloatArray", sensor: "Sensor", options: "SimulationOptions", share: float | None
) -> "tuple[FloatArray, Saturation | None]":
    """Return the scene with its exposure, and the share of its picture that saturates."""
    from camkit.runtime.twin.saturation import exposure_for_share, saturation_of
    from camkit.scenes.saturation import with_exposure

    if sensor.type == "spad":
        if share is not None:
            raise ContractError("--saturate is for sensors that clip; this one counts photons")
        return scene, None
    inner = slice(options.surround_px, -options.surround_px or None)
    inside = scene[:, inner, inner]
    if share is None:
        return scene, saturation_of(inside, sensor, options.exposure)
    saturation = exposure_for_share(inside, sensor, share)
    return with_exposure(scene, saturation.exposure), saturation


def _facts(
    out: Path, truth: Path | None, simulation: "Simulation", saturation: "Saturation | None"
) -> dict[str, Any]:
    """Return the object that `--json` prints."""
    height, width = simulation.samples.shape[-2:]
    facts = {
        "path": str(out),
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


def _line(out: Path, simulation: "Simulation", saturation: "Saturation | None") -> str:
    """Return the line for people; a saturation only where it was asked for."""
    from camkit.contracts import depth_name

    height, width = simulation.samples.shape[-2:]
    line = f"{out}: {width}x{height}, ISO {simulation.iso:g}"
    if simulation.depth_mm is not None:
        line += f", {depth_name(simulation.depth_mm)} away"
    if saturation is None:
        return line
    return (
        f"{line}, exposure {saturation.exposure:.4g}, "
        f"{saturation.saturated_fraction:.2%} saturated, peak {saturation.peak:.4g}"
    )


def _depth_mm(bundle: "Bundle") -> float | None:
    """Return the distance of focus; None for a camera that states no optics."""
    return None if bundle.manifest.optics is None else bundle.reference_depth_mm


def _focus_um(path: Path | None, bundle: "Bundle") -> float:
    """Return the focus of a body, which must be one of the bundle's camera."""
    if path is None:
        return 0.0
    from camkit.runtime.unit import read_unit

    unit = read_unit(path)
    unit.check(bundle)
    return unit.focus_um


@working("reading or drawing the scene")
def _scene(scene: str, size_px: tuple[int, int], surround_px: int, *, is_cut: bool) -> "FloatArray":
    """Draw or read a scene with its surround.

    Raises:
        ContractError: If a picture is smaller than what is to be cut from it.
    """
    from camkit.scenes import is_scene_name, named_scene

    width, height = (side + 2 * surround_px for side in size_px)
    if min(size_px) < 1:
        raise ContractError(f"--size-px takes two numbers >= 1; got {size_px[0]},{size_px[1]}")
    if is_scene_name(scene):
        return named_scene(scene, height, width)
    from camkit.runtime.files.picture import read_light

    light = read_light(Path(scene))
    if not is_cut:
        return light
    rows, columns = light.shape[-2:]
    if width > columns or height > rows:
        ring = f" with a ring of {surround_px} px" if surround_px else ""
        raise ContractError(
            f"{scene} has {columns}x{rows} pixels; --size-px {size_px[0]},{size_px[1]}{ring} needs "
            f"{width}x{height}: take a smaller size, or leave it out"
        )
    top, left = (rows - height) // 2, (columns - width) // 2
    return light[:, top : top + height, left : left + width]
