"""`camkit simulate`: the digital twin, a sharp scene to a capture such as a Bayer DNG."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from camkit.cli.choices import Debug, DepthM, FrozenState, Json, Overwrite, whole_pair
from camkit.cli.say import say
from camkit.units import MM_PER_M


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
    configuration: FrozenState = None,
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
        typer.Option(
            help="Also write the ideal picture of a perfect lens and sensor (.exr); not for SPAD."
        ),
    ] = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Simulate a capture of a scene: blur, vignetting, noise and saturation of the camera.

    A picture of 8 or 16 bits is sRGB, EXR and Radiance HDR are linear. A camera that counts photons
    also takes an NPZ with depth_m and albedo, or with transient.
    """
    from camkit.runtime.face import simulation

    capture = simulation.simulate(
        scene,
        bundle,
        out,
        iso=iso,
        seed=seed,
        origin_px=None if origin_px is None else whole_pair(origin_px, "--origin-px"),
        exposure=exposure,
        saturate=saturate,
        photons=photons,
        sbr=sbr,
        surround_px=surround_px,
        bits=bits,
        plate=not no_plate,
        depth_m=depth_m,
        configuration=configuration,
        unit=unit,
        size_px=None if size_px is None else whole_pair(size_px, "--size-px"),
        truth=truth,
        overwrite=overwrite,
    )
    if json_:
        say(json.dumps(capture.facts, allow_nan=False))
    else:
        say(_line(capture.facts, with_saturation=saturate is not None))
        for note in capture.facts.get("notes", ()):
            say(f"  note: {note}", err=True)


def _line(facts: Mapping[str, Any], *, with_saturation: bool) -> str:
    """Return the line for people; a saturation only where it was asked for."""
    if "counts" in facts:
        shape = "x".join(map(str, facts["shape"]))
        return f"{', '.join(facts['files'])}: {facts['array']} {shape}, {facts['counts']} counts"
    from camkit.psf import depth_name

    width, height = facts["size"]
    line = f"{facts['path']}: {width}x{height}, ISO {facts['iso']:g}"
    distance_m = facts["object_distance_m"]
    if distance_m is not None:
        line += f", {depth_name(float(distance_m) * MM_PER_M)} away"
    if with_saturation:
        line += (
            f", exposure {facts['exposure']:.4g}, {facts['saturated_fraction']:.2%} saturated, "
            f"peak {facts['peak']:.4g}"
        )
    return line
