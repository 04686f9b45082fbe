"""The card of a bundle for people, and its preview picture."""

import io
from collections.abc import Mapping

import numpy as np

from camkit.bundle.golden import GoldenArrays
from camkit.bundle.reader import Bundle
from camkit.colorimetry import encode_srgb
from camkit.contracts import FloatArray, depth_name
from camkit.export.energy import energy_diameter_px, modulation

BORDER_PX = 16


def card_text(bundle: Bundle, golden: Mapping[str, GoldenArrays]) -> str:
    """Write the card: what it is, what it was trained on, what was measured, where it fails."""
    manifest = bundle.manifest
    camera, psf = manifest.camera, bundle.psf
    depths = ", ".join(map(depth_name, psf.depths_mm))
    lines = [
        f"# {manifest.name} {manifest.version}",
        "",
        f"Sensor {camera.width_px}x{camera.height_px} of {camera.pixel_pitch_um} um, "
        f"{camera.cfa or 'no mosaic'}, full well {camera.full_well_e:g} e-. "
        f"PSF frozen at {psf.field_heights_mm.size} field heights and "
        f"{psf.wavelengths_um.size} wavelengths, {psf.kernels.shape[-1]} px a side, "
        f"for objects at {depths}.",
        "",
        f"Licence of the weights: {manifest.licence}. Trained on: {manifest.training_data}.",
        "",
        f"Response of the colours: {camera.channel_response.source}.",
        "",
        "## PSF over the field" + (", mean of the depths" if psf.depths_mm.size > 1 else ""),
        "",
        "| field height (mm) | circle of 95 % energy (px) | MTF at 0.1 cycles/px | illumination |",
        "|---|---|---|---|",
    ]
    for i, height in enumerate(psf.field_heights_mm):
        kernel = psf.kernels[i].mean(axis=(0, 1))
        lines.append(
            f"| {height:.2f} | {energy_diameter_px(kernel, 0.95):.0f} | "
            f"{modulation(kernel, 0.1):.2f} | {psf.relative_illumination[i]:.3f} |"
        )
    lines += [
        "",
        "## Networks",
        "",
        "| size | kMAC/px | parameters | reach (px) |",
        "|---|---|---|---|",
    ]
    for size, facts in manifest.networks.items():
        lines.append(
            f"| {size} | {facts.mac_per_pixel / 1e3:.1f} | {facts.parameters} | {facts.reach_px} |"
        )
    lines += [
        "",
        "## Golden cases (same PSF, PSNR in dB on sRGB values)",
        "",
        "| case | " + " | ".join(manifest.networks) + " |",
        "|---|" + "---|" * len(manifest.networks),
    ]
    for name, arrays in golden.items():
        values = (
            f"{_psnr_db(arrays.outputs[size], arrays.reference):.2f}" for size in manifest.networks
        )
        lines.append(f"| {name} | " + " | ".join(values) + " |")
    lines += [
        "",
        "## Where it fails",
        "",
        f"Depths other than {depths}, sources that clip over more than the PSF, light of a narrow "
        "band, and lenses off by more than the fabrication errors it was trained with "
        "(radius 0.2 %, thickness 0.03 mm, index 0.0005, focus 0.02 mm).",
        "",
    ]
    return "\n".join(lines)


def preview_png(bundle: Bundle, golden: Mapping[str, GoldenArrays]) -> bytes:
    """Draw PSFs and MTFs over the field, and the golden cases with their references."""
    from matplotlib.figure import Figure

    psf = bundle.psf
    shown = np.linspace(0, psf.field_heights_mm.size - 1, 5).round().astype(int)
    figure = Figure(figsize=(10, 7.5), dpi=80, layout="constrained")
    axes = figure.subplots(3, 5)
    for column, i in enumerate(shown):
        kernel = psf.kernels[i].mean(axis=0)
        thirds = np.array_split(np.arange(kernel.shape[0]), 3)
        picture = np.stack([kernel[part].mean(axis=0) for part in reversed(thirds)], axis=-1)
        axes[0, column].imshow((picture / picture.max()) ** 0.5)
        axes[0, column].set_title(f"{psf.field_heights_mm[i]:.1f} mm", fontsize=9)
        axes[0, column].axis("off")
        frequencies = np.linspace(0.0, 0.5, 26)
        mean = kernel.mean(axis=0)
        axes[1, column].plot(frequencies, [modulation(mean, f) for f in frequencies])
        axes[1, column].set_ylim(0, 1)
        axes[1, column].set_xlabel("cycles/px", fontsize=8)
    axes[1, 0].set_ylabel("MTF")
    for column, (name, arrays) in enumerate(golden.items()):
        best = list(arrays.outputs)[-1]
        gain = 1 / max(float(np.quantile(arrays.reference, 0.99)), 1e-3)
        pair = np.concatenate([arrays.outputs[best], arrays.reference], axis=1) * gain
        axes[2, column].imshow(encode_srgb(pair.astype(np.float32)).transpose(1, 2, 0))
        axes[2, column].set_title(f"{name}: {best} over truth", fontsize=8)
    for axis in axes[2]:
        axis.axis("off")
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def _psnr_db(image: FloatArray, reference: FloatArray) -> float:
    inside = np.s_[:, BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]
    error = encode_srgb(image[inside]) - encode_srgb(reference[inside])
    return float(-10 * np.log10(max(float(np.mean(np.square(error))), 1e-12)))
