"""Measurements and lensfun's database into bundles, and an entry for lensfun out of them."""

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from camkit.bundle.psf_file import read_psf
from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.bundle.writer import write_bundle
from camkit.calibrate.result_files import check_results, write_results
from camkit.calibration.lensfun.entry import Entry, EntryOptions, lensfun_entry
from camkit.calibration.lensfun.ordinary import CameraOptions, LensBundle, lensfun_bundle
from camkit.calibration.measured_files import GeometryFile, read_flat, read_geometry, read_noise
from camkit.caller import option_list, option_text
from camkit.errors import BundleError, ContractError, DecodeError
from camkit.export.remeasured import Measured, remeasured
from camkit.field_types import checked
from camkit.report.pages.calibration.bundle_page import bundle_html as measured_html
from camkit.report.pages.calibration.lensfun_page import bundle_html, entry_html
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.files.in_memory import FilePath
from camkit.runtime.output.part_file import atomic_output


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredBundle:
    """The result of `bundle`.

    Attributes:
        bundle: The copy.
        source: The bundle that it is a copy of.
        files: What was measured -> its file.
        geometry: The measured geometry; None for none.
        notes: What the user should know.
    """

    bundle: Bundle
    source: Bundle
    files: Mapping[str, Path]
    geometry: GeometryFile | None
    notes: tuple[str, ...]

    def to_record(self) -> dict[str, Any]:
        """Return plain values."""
        geometry = self.geometry
        return {
            "from": self.source.manifest.name,
            "measured": {name: str(path) for name, path in self.files.items()},
            "model": None if geometry is None else geometry.model,
            "residual_px": None if geometry is None else geometry.radial.residual_px,
            "networks": list(self.bundle.manifest.sizes),
            "golden": [case.name for case in self.bundle.manifest.golden],
            "left_out": sorted({*self.source.names} - {*self.bundle.names}),
            "notes": list(self.notes),
        }


@checked
def bundle(
    source: FilePath,
    out: FilePath,
    *,
    geometry: FilePath | None = None,
    flat: FilePath | None = None,
    noise: FilePath | None = None,
    psf: FilePath | None = None,
    keep_networks: bool = False,
    page: FilePath | None = None,
    overwrite: bool = False,
) -> MeasuredBundle:
    """Store the measurements of a camera in a copy of a bundle and verify it.

    Args:
        source: Bundle to copy, name or path.
        out: New bundle to write (.camkit).
        geometry: Distortion and optical centre (.toml of `geometry`).
        flat: Vignetting (.toml of `flat`).
        noise: Gain, read noise and levels (.toml of `noise`).
        psf: Kernels (.safetensors of `psf` or `import_psf`), resampled to the pixels of the
            bundle if need be; drops the networks.
        keep_networks: Keep the networks even if the kernels change.
        page: Page to write (.html); None writes none.
        overwrite: Whether files that exist are replaced.

    Raises:
        ContractError: If an option is wrong, or a file exists.
        DecodeError: If a measurement cannot be read or does not fit the bundle.
        ParityError: If the new bundle fails its check.
    """
    out_file, page_file = check_results(out, ".camkit", page, overwrite=overwrite)
    if keep_networks and psf is None:
        raise ContractError(
            f"{option_text('keep_networks')} belongs to {option_text('psf')}; without it they stay"
        )
    paths = {"geometry": geometry, "flat": flat, "noise": noise, "psf": psf}
    files = {name: Path(path) for name, path in paths.items() if path is not None}
    if not files:
        raise ContractError(f"give what was measured: {option_list(list(paths))}")
    before = open_bundle(find_bundle(str(source)))
    try:
        kernels = read_psf(files["psf"]) if "psf" in files else None
    except BundleError as error:  # a file that was measured, and no bundle, is refused here
        raise DecodeError(str(error)) from error
    measured = Measured(
        geometry=read_geometry(files["geometry"]) if "geometry" in files else None,
        flat=read_flat(files["flat"]) if "flat" in files else None,
        noise=read_noise(files["noise"]) if "noise" in files else None,
        psf=kernels,
    )
    for path in filter(None, (out_file, page_file)):
        path.parent.mkdir(parents=True, exist_ok=True)
    after, notes = remeasured(before, measured, Path(out), keep_networks=keep_networks)
    result = MeasuredBundle(
        bundle=after, source=before, files=files, geometry=measured.geometry, notes=notes
    )
    if page_file is not None:
        record = {**result.to_record(), "out": str(out)}
        with atomic_output(page_file) as part:
            part.write_text(measured_html(before, after, record), encoding="utf-8")
    return result


@checked
def lensfun_in(
    database: FilePath,
    lens: str,
    focal_mm: float,
    capture: FilePath,
    out: FilePath,
    *,
    aperture: float | None = None,
    distance_m: float | None = None,
    crop_factor: float | None = None,
    scale: float | None = None,
    mosaic: MosaicOptions | None = None,
    page: FilePath | None = None,
    overwrite: bool = False,
) -> LensBundle:
    """Make a bundle that corrects distortion and vignetting of a lens from a lensfun database.

    Args:
        database: Folder of a lensfun database, or one of its XML files.
        lens: Model of the lens, as written in the database.
        focal_mm: Focal length of the captures.
        capture: Example capture; the bundle fits captures like it.
        out: Bundle to write (.camkit).
        aperture: F-number for the vignetting; None for what the capture states.
        distance_m: Object distance for the vignetting; None for far.
        crop_factor: Of the sensor; None for that of the pixel pitch, else the camera's.
        scale: Of the corrected picture; None for the largest up to 1 without repeated borders.
        mosaic: How to read a headerless mosaic, or levels in place of the file's.
        page: Page to write (.html); None writes none.
        overwrite: Whether files that exist are replaced.

    Raises:
        ContractError: If an option is wrong, or a file exists.
        DecodeError: If database or capture cannot be read, or the lens is not there.
    """
    _, page_file = check_results(out, ".camkit", page, overwrite=overwrite)
    options = CameraOptions(
        focal_mm=focal_mm,
        aperture=aperture,
        distance_m=distance_m,
        crop_factor=crop_factor,
        scale=scale,
        mosaic=mosaic,
    )
    path = Path(out)
    profile = lensfun_bundle(Path(database), lens, Path(capture), options, name=path.stem)
    path.parent.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        if page_file is not None:
            page_file.parent.mkdir(parents=True, exist_ok=True)
            part = stack.enter_context(atomic_output(page_file))
            part.write_text(bundle_html(profile), encoding="utf-8")
        write_bundle(path, profile.manifest, {})
    return profile


@checked
def lensfun_out(
    source: FilePath,
    out: FilePath | None = None,
    *,
    focal_mm: float | None = None,
    lens_name: str | None = None,
    maker: str = "Generic",
    mount: str = "Generic",
    crop_factor: float | None = None,
    aperture: float | None = None,
    most_residual_px: float = 0.5,
    page: FilePath | None = None,
    overwrite: bool = False,
) -> Entry:
    """Write distortion and vignetting of a bundle or a measured geometry for lensfun.

    Args:
        source: Bundle, name or path, or geometry (.toml of `geometry`).
        out: Entry to write (.xml); None writes none.
        focal_mm: Required for a bundle; None for that of the geometry.
        lens_name: Model of the lens; None for the name of the source.
        maker: Maker of the lens.
        mount: Mount of the camera, as named in the database.
        crop_factor: Required for a geometry; None for that of the sensor of the bundle.
        aperture: F-number at which the vignetting of a bundle is written; None for none.
        most_residual_px: Largest misfit of the distortion model.
        page: Page to write (.html); None writes none.
        overwrite: Whether files that exist are replaced.

    Raises:
        ContractError: If an option is wrong, or a file exists.
        DecodeError: If the source cannot be read, or no model of lensfun fits it.
    """
    outputs = check_results(out, ".xml", page, overwrite=overwrite)
    options = EntryOptions(
        focal_mm=focal_mm,
        lens_name=lens_name,
        maker=maker,
        mount=mount,
        crop_factor=crop_factor,
        aperture=aperture,
        most_residual_px=most_residual_px,
    )
    entry = lensfun_entry(Path(source), options)
    write_results(outputs, lambda: entry.to_xml().encode(), lambda: entry_html(entry))
    return entry
