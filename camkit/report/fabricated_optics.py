"""Optics of fabricated lenses, traced afresh and more densely than the bundle's frozen ones.

    prescription of the bundle -> fabrication errors, focused at assembly -> trace -> FrozenOptics

A restoration is judged on captures through these, never only through the PSF it was given.
"""

import hashlib
from pathlib import Path
from typing import Final

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.haze_file import read_haze, write_haze
from camkit.bundle.psf_file import read_psf, write_psf
from camkit.bundle.reader import Bundle
from camkit.errors import ContractError
from camkit.psf import FrozenPsf
from camkit.runtime.twin.truth import light_sensor
from camkit.side_file import read_side_text

PRESCRIPTION: Final = "prescription.toml"
MAX_SIDE_PX: Final = 161
LARGER_PX: Final = 50
"""The window may be as wide as the first, and wider by the second than the bundle's kernels."""
ENERGY: Final = 0.997
LEAST_ENERGY: Final = 0.95
"""Share of light inside the traced kernels: more than a frozen PSF must hold, and what will do
where a lens throws its light farther than the widest window."""


def fabricated_optics(
    bundle: Bundle,
    seed: int,
    *,
    cache_folder: Path,
    prescription: Path | None = None,
    depth_mm: float | None = None,
    dense: bool = True,
) -> FrozenOptics:
    """Trace one fabricated copy of a bundle's lens, or read what an earlier call traced.

    Where `dense`, the field grid is twice and the wavelength grid three times as dense as the
    bundle's; the object lies at one distance. A lens with a haze is frozen on its own grid, haze
    included, a minute and a half for a plate of 24 megapixels.

    Errors are uniform: radius +-0.2 %, thickness +-0.03 mm, index +-0.0005; the copy is focused at
    assembly to +-0.02 mm (lengths less below 40 mm of focal length, see `usual_errors`).

    Args:
        bundle: Names the lens, the camera and the grid.
        seed: Of the fabrication errors.
        cache_folder: Where traced optics are kept.
        prescription: The lens, if the bundle does not hold it.
        depth_mm: Object distance; None for the bundle's reference depth, which alone a lens with a
            haze has.
        dense: Else the grid is the bundle's own, a sixth of the kernels.

    Raises:
        ContractError: If the lens is not known or its light does not fit the kernels.
    """
    text = lens_text(bundle, prescription)
    if bundle.manifest.has_haze and depth_mm not in (None, bundle.reference_depth_mm):
        raise ContractError("a lens with a haze is traced at its reference depth alone")
    depth_mm = bundle.reference_depth_mm if depth_mm is None else depth_mm
    shape = bundle.psf.kernels.shape
    content = [text, bundle.manifest.sensor.model_dump_json(), repr((shape[:3], seed))]
    content += [bundle.configuration] if bundle.configuration else []
    content.append(repr((_max_side_px(bundle.psf), ENERGY, [depth_mm])))
    if bundle.manifest.has_haze:
        content.append(repr(bundle.haze.cell_px))
    if not dense:
        content.append("own grid")
    name = hashlib.sha256("\n".join(content).encode()).hexdigest()[:16]
    cached = cache_folder / f"psf-{seed}-{name}.safetensors"
    haze_path = cached.with_stem(f"haze-{seed}-{name}") if bundle.manifest.has_haze else None
    if not cached.exists():
        cache_folder.mkdir(parents=True, exist_ok=True)
        traced = _trace(bundle, text, seed, depth_mm, dense=dense)
        if haze_path is not None and traced.haze is not None:
            write_haze(haze_path, traced.haze)
        write_psf(cached, traced.psf)
    return FrozenOptics(
        psf=read_psf(cached), haze=None if haze_path is None else read_haze(haze_path)
    )


def _max_side_px(psf: FrozenPsf) -> int:
    return max(MAX_SIDE_PX, int(psf.kernels.shape[-1]) + LARGER_PX)


def lens_text(bundle: Bundle, prescription: Path | None) -> str:
    """Return the prescription as TOML: the file's, or else the bundle's own.

    Raises:
        ContractError: If there is neither.
    """
    if prescription is not None:
        return read_side_text(prescription, "the lens")
    if PRESCRIPTION not in bundle.names:
        raise ContractError(
            f"{bundle.path.name} holds no {PRESCRIPTION}, so its PSF cannot be traced afresh; "
            "give the lens with --prescription"
        )
    return bundle.member(PRESCRIPTION).decode("utf-8")


def _trace(bundle: Bundle, text: str, seed: int, depth_mm: float, *, dense: bool) -> FrozenOptics:
    from camkit.models_def.optics.analysis.psf_model import checked_regime
    from camkit.models_def.optics.frozen import FreezeGrid, dense_grid, freeze
    from camkit.models_def.optics.kernel_bank import focused_copies
    from camkit.models_def.optics.lens_file.states import plain_lens
    from camkit.models_def.optics.lens_optics import LensOptics
    from camkit.models_def.optics.prescription import parse_prescription
    from camkit.models_def.optics.thin.hazy_freezing import (
        COPY_RAYS,
        LEAST_FIELDS,
        HazyGrid,
        freeze_hazy,
    )

    sensor = light_sensor(bundle.manifest)
    lens = plain_lens(parse_prescription(text), bundle.configuration or None)
    _, copy = focused_copies(lens, 2, seed)
    psf = bundle.psf
    if bundle.manifest.has_haze:
        fields, _, waves, side_px, _ = psf.kernels.shape
        hazy_grid = HazyGrid(
            fields=max(fields, LEAST_FIELDS),
            wavelengths=waves,
            core_px=side_px // 2,
            cell_px=bundle.haze.cell_px,
            rays=COPY_RAYS,
        )
        return freeze_hazy(copy, sensor, hazy_grid)[0]
    frozen_grid = FreezeGrid(
        fields=psf.field_heights_mm.size,
        wavelengths=psf.wavelengths_um.size,
        depths_mm=(depth_mm,),
        energy=ENERGY,
        max_side_px=_max_side_px(psf),
        least_energy=LEAST_ENERGY,
    )
    # bundles of before waves do not say it
    regime = checked_regime(str(bundle.freeze_fact("psf_model") or "rays")) or "rays"
    grid = dense_grid(frozen_grid) if dense else frozen_grid
    traced = freeze(LensOptics(lens=copy, regime=regime), sensor, grid)
    return FrozenOptics(psf=traced.psf)
