"""`camkit calibrate bundle`: what was measured of a camera, into a copy of a bundle."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.use.calibrate.outputs import Page, check_out, check_page, tell
from camkit.errors import BundleError, ContractError, DecodeError


def bundle(
    source: Annotated[str, typer.Argument(metavar="FROM", help="Bundle to copy, NAME or PATH.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="New bundle to write (.camkit).")],
    geometry: Annotated[
        Path | None,
        typer.Option(help="Distortion and optical centre (.toml of `camkit calibrate geometry`)."),
    ] = None,
    flat: Annotated[
        Path | None, typer.Option(help="Vignetting (.toml of `camkit calibrate flat`).")
    ] = None,
    noise: Annotated[
        Path | None,
        typer.Option(help="Gain, read noise and levels (.toml of `camkit calibrate noise`)."),
    ] = None,
    psf: Annotated[
        Path | None,
        typer.Option(help="Kernels (.safetensors of `camkit calibrate psf`); drops the networks."),
    ] = None,
    keep_networks: Annotated[
        bool, typer.Option("--keep-networks", help="Keep the networks even if the kernels change.")
    ] = False,
    page: Page = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Store the measurements of a camera in a copy of a bundle and verify it."""
    check_out(out, ".camkit", "a bundle", overwrite=overwrite)
    check_page(page, overwrite=overwrite)
    if keep_networks and psf is None:
        raise ContractError("--keep-networks belongs to --psf; without it they stay")
    if (geometry, flat, noise, psf) == (None, None, None, None):
        raise ContractError("give what was measured: --geometry, --flat, --noise, --psf")
    from camkit.bundle.psf_file import read_psf
    from camkit.bundle.reader import find_bundle, open_bundle
    from camkit.calibration.measured_files import read_flat, read_geometry, read_noise
    from camkit.export.remeasured import Measured, remeasured

    original = open_bundle(find_bundle(source))
    try:
        kernels = None if psf is None else read_psf(psf)
    except BundleError as error:  # a file that was measured, and no bundle, is refused here
        raise DecodeError(str(error)) from error
    measured = Measured(
        geometry=None if geometry is None else read_geometry(geometry),
        flat=None if flat is None else read_flat(flat),
        noise=None if noise is None else read_noise(noise),
        psf=kernels,
    )
    for path in (out, page or out):
        path.parent.mkdir(parents=True, exist_ok=True)
    copy, notes = remeasured(original, measured, out, keep_networks=keep_networks)
    files = {"geometry": geometry, "flat": flat, "noise": noise, "psf": psf}
    sources = {name: str(path) for name, path in files.items() if path is not None}
    lens = measured.geometry
    record = {
        "from": original.manifest.name,
        "measured": sources,
        "model": None if lens is None else lens.model,
        "residual_px": None if lens is None else lens.radial.residual_px,
        "networks": list(copy.manifest.sizes),
        "golden": [case.name for case in copy.manifest.golden],
        "left_out": sorted({*original.names} - {*copy.names}),
        "notes": list(notes),
        "out": str(out),
    }
    if page is not None:
        from camkit.report.calibration.bundle_page import bundle_html
        from camkit.runtime.output.part_file import atomic_output

        with atomic_output(page) as part:
            part.write_text(bundle_html(original, copy, record), encoding="utf-8")
        record["page"] = str(page)
    line = f"  {original.manifest.name} with {', '.join(sources)} as measured"
    tell(record, [line], as_json=json_)
