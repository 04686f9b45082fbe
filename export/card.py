"""The card of a bundle for people, and its preview picture."""

import io
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.golden import IMAGE, NO_SIZE, GoldenArrays
from camkit.bundle.manifest import Manifest
from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import Sensor
from camkit.colorimetry import encode_srgb
from camkit.export.energy import energy_diameter_px, modulation
from camkit.psf import depth_name
from camkit.runtime.proof.laws.law import number_text
from camkit.runtime.proof.laws.proof import MeasuredLaws

BORDER_PX: Final = 16
FILTER: Final = "filter"
"""Heads the results of a bundle without networks."""
_LAWS: Final = "\n## Laws of a picture"
_PLACES: Final = {"radial": "field heights", "uniform": "place", "grid": "places"}


def card_text(
    bundle: Bundle,
    golden: Mapping[str, GoldenArrays],
    fails_on: Sequence[str] = (),
    whites: Mapping[str, float] | None = None,
) -> str:
    """Return the card: the camera, its training data, its measurements, its failures.

    Args:
        bundle: The camera, with its networks.
        golden: Its golden cases, outputs included.
        fails_on: What it fails on, besides objects at other depths.
        whites: Name of a case -> what is white in its pictures; 1 unless stated.
    """
    manifest = bundle.manifest
    sensor, psf = manifest.sensor, bundle.psf
    depths = ", ".join(map(depth_name, psf.depths_mm))
    lines = [
        _title(manifest),
        "",
        f"Sensor {sensor.width_px}x{sensor.height_px} of {sensor.pixel_pitch_um} um, "
        f"{sensor.text}. "
        f"PSF frozen at {psf.field_heights_mm.size} {_PLACES[psf.symmetry]} and "
        f"{psf.wavelengths_um.size} wavelengths, {psf.kernels.shape[-1]} px a side, "
        f"for objects at {depths}.",
        "",
        f"Licence of the weights: {manifest.licence}. Trained on: {manifest.training_data}."
        if manifest.networks
        else "No network: the filter restores alone.",
        "",
        *_response(sensor),
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
    sizes = manifest.sizes or (NO_SIZE,)
    lines += ["", "## Networks", "", *_networks(bundle), ""]
    lines += ["## Golden cases (same PSF, PSNR in dB on sRGB values)", ""]
    lines += [
        "| case | " + " | ".join(manifest.sizes or (FILTER,)) + " |",
        "|---|" + "---|" * len(sizes),
    ]
    for name, arrays in _pictures(golden).items():
        images, white = arrays.outputs[IMAGE], np.float32((whites or {}).get(name, 1.0))
        values = (
            f"{picture_psnr_db(images[size] / white, arrays.reference / white):.2f}"
            for size in sizes
        )
        lines.append(f"| {name} | " + " | ".join(values) + " |")
    lines += [
        "",
        "## Where it fails",
        "",
        ", ".join([f"Depths other than {depths}", *fails_on]) + ".",
        "",
    ]
    return "\n".join(lines)


def laws_text(measured: MeasuredLaws) -> str:
    """Return the part of the card that states which laws of a picture its networks keep."""
    if isinstance(measured, str):
        return f"\nLaws of a picture: {measured}.\n"
    lines = [f"{_LAWS} (`camkit check --level laws`)", ""]
    lines += ["| size | law | worst | admitted | front end | |", "|---|---|---|---|---|---|"]
    for size, laws in measured.items():
        for law in laws:
            front = "" if law.front is None else number_text(law.front, law.unit)
            verdict = "kept" if law.is_kept else f"BROKEN: {law.where}"
            lines.append(
                f"| {size or ''} | {law.name.replace('_', ' ')} | "
                f"{number_text(law.worst, law.unit)} | {number_text(law.limit, law.unit)} | "
                f"{front} | {verdict} |"
            )
    return "\n".join([*lines, ""])


def with_laws_text(card: str, manifest: Manifest, measured: MeasuredLaws) -> str:
    """Return a card that names another version of its bundle, and other laws.

    Args:
        card: Of the bundle as it was.
        manifest: As it is now.
        measured: What was measured.
    """
    _, _, rest = card.partition("\n")
    body, _, _ = rest.partition(_LAWS)
    return f"{_title(manifest)}\n{body}{laws_text(measured)}"


def _title(manifest: Manifest) -> str:
    return f"# {manifest.name} {manifest.version}"


def _response(sensor: Sensor) -> list[str]:
    if sensor.channel_response is None:
        return []
    return [f"Response of the colours: {sensor.channel_response.source}.", ""]


def _networks(bundle: Bundle) -> list[str]:
    """Return a table of every network; with roles where there are several."""
    networks = bundle.manifest.networks
    if not networks:
        return ["None."]
    rows = ["| network | kMAC/px | parameters | reach (px) |", "|---|---|---|---|"]
    for role, sizes in networks.items():
        for size, facts in sizes.items():
            name = size if len(networks) == 1 else f"{size} ({role})"
            rows.append(
                f"| {name} | {facts.mac_per_pixel / 1e3:.1f} | {facts.parameters} | "
                f"{facts.reach_px} |"
            )
    return rows


def preview_png(bundle: Bundle, golden: Mapping[str, GoldenArrays]) -> bytes:
    """Draw PSFs and MTFs over the field, and the golden cases with their references."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    psf = bundle.psf
    fields = np.unique(np.linspace(0, psf.field_heights_mm.size - 1, 5).round().astype(int))
    figure = Figure(figsize=(10, 7.5), dpi=80, layout="constrained")
    axes = figure.subplots(3, 5)
    for column, i in enumerate(fields):
        kernel = psf.kernels[i].mean(axis=0)
        bands = np.arange(kernel.shape[0])
        thirds = np.array_split(bands, 3) if bands.size >= 3 else [bands] * 3
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
    best = (bundle.manifest.sizes or (NO_SIZE,))[-1]
    best_name = best if bundle.manifest.sizes else FILTER
    for column, (name, arrays) in enumerate(_pictures(golden).items()):
        image = arrays.outputs[IMAGE][best]
        gain = 1 / max(float(np.quantile(arrays.reference, 0.99)), 1e-3)
        pair = np.concatenate([image, arrays.reference], axis=1) * gain
        pair = np.broadcast_to(pair, (3, *pair.shape[1:]))
        axes[2, column].imshow(encode_srgb(pair.astype(np.float32)).transpose(1, 2, 0))
        axes[2, column].set_title(f"{name}: {best_name} over truth", fontsize=8)
    for axis in (*axes[0, fields.size :], *axes[1, fields.size :], *axes[2]):
        axis.axis("off")
    buffer = io.BytesIO()
    canvas: Any = FigureCanvasAgg(figure)
    canvas.print_png(buffer, metadata={"Software": None})
    return buffer.getvalue()


def _pictures(golden: Mapping[str, GoldenArrays]) -> dict[str, GoldenArrays]:
    """Return the cases that the pipeline makes pictures of."""
    return {name: arrays for name, arrays in golden.items() if IMAGE in arrays.outputs}


def picture_psnr_db(image: FloatArray, reference: FloatArray) -> float:
    """Return the PSNR of (3, h, w) linear pictures in dB of sRGB values, borders left out."""
    inside = np.s_[:, BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]
    error = encode_srgb(image[inside]) - encode_srgb(reference[inside])
    return float(-10 * np.log10(max(float(np.mean(np.square(error))), 1e-12)))
