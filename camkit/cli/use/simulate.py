"""`camkit simulate`: the digital twin, a sharp scene to a capture such as a Bayer DNG."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Debug, DepthM, Overwrite, whole_pair
from camkit.cli.say import say
from camkit.errors import ContractError
from camkit.units import MM_PER_M

if TYPE_CHECKING:
    from camkit.bundle.reader import Bundle


def simulate(
    scene: Annotated[
        str,
        typer.Argument(
            help="A picture (8/16-bit sRGB, linear EXR or HDR), procedural:SEED or night:SEED."
        ),
    ],
    bundle: Annotated[str, typer.Option(help="Bundle NAME or PATH of the camera.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="The capture to write, such as a DNG.")],
    iso: Annotated[float, typer.Option(help="ISO speed of the capture.")] = 100.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
    origin_px: Annotated[
        str | None, typer.Option(help="X,Y of a crop on the sensor; default: centred.")
    ] = None,
    exposure: Annotated[float, typer.Option(help="Factor on the scene's radiance.")] = 1.0,
    depth_m: DepthM = None,
    size_px: Annotated[
        str | None, typer.Option(help="W,H of a scene of a seed; default: the sensor.")
    ] = None,
    overwrite: Overwrite = False,
    _debug: Debug = False,
) -> None:
    """Photograph a scene with the bundle's camera: blur, vignetting, noise, saturation."""
    from camkit.bundle.reader import find_bundle, open_bundle
    from camkit.contracts import depth_name
    from camkit.runtime.kind import part_of
    from camkit.runtime.network.engine import available_threads
    from camkit.runtime.twin.simulate import SimulationOptions

    if out.exists() and not overwrite:
        raise ContractError(f"{out} exists; say --overwrite or another name")
    opened = open_bundle(find_bundle(bundle))
    part, sensor = part_of(opened.manifest), opened.manifest.sensor
    if out.suffix.lower() != part.suffix:
        raise ContractError(
            f"a simulated capture of this camera is a {part.suffix[1:].upper()}; expected a name "
            f"in {part.suffix}, got {out}"
        )
    whole = (sensor.width_px, sensor.height_px)
    size = whole if size_px is None else whole_pair(size_px, "--size-px")
    options = SimulationOptions(
        iso=iso,
        seed=seed,
        origin_px=None if origin_px is None else whole_pair(origin_px, "--origin-px"),
        exposure=exposure,
        depth_mm=_depth_mm(opened) if depth_m is None else depth_m * MM_PER_M,
        workers=available_threads(None),
    )
    simulation = part.simulate(_scene(scene, size), opened, options)
    out.parent.mkdir(parents=True, exist_ok=True)
    part.write(out, simulation, opened)
    height, width = simulation.samples.shape[-2:]
    depth = "" if simulation.depth_mm is None else f", {depth_name(simulation.depth_mm)} away"
    say(f"{out}: {width}x{height}, ISO {iso:g}{depth}")


def _depth_mm(bundle: "Bundle") -> float | None:
    """Give the distance of focus; None for a camera that states no optics."""
    return None if bundle.manifest.optics is None else bundle.reference_depth_mm


def _scene(scene: str, size_px: tuple[int, int]):  # type: ignore[no-untyped-def]  # numpy stays lazy
    from camkit.scenes import is_scene_name, named_scene

    if is_scene_name(scene):
        return named_scene(scene, size_px[1], size_px[0])
    from camkit.runtime.files.picture import read_light

    return read_light(Path(scene))
