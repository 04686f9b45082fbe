"""The rows of the quality comparison, made from bundles and tuned parameters."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.optics import PSF
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Network, Wiener
from camkit.errors import ContractError
from camkit.psf import depth_name
from camkit.report.quality import BORDER_PX, FABRICATION_SEEDS, FIELD_SHARES
from tools.capture.simulated import color_sensor
from tools.comparison.measurement import Row, identity_of
from tools.comparison.names import CLASSICAL, EARLIER
from tools.comparison.peers import PEERS, Setting, part_sides
from tools.comparison.photograph import (
    PROTOCOL_VERSION,
    Photograph,
    Restorer,
    bundle_restorer,
    finish_planes,
)
from tools.comparison.tuning import Tuned, tuned_to_json

BANK_METHODS: Final = {"bank": "wiener", "bank_rl": "rl", "bank_admm_tv": "admm-tv"}
PEER_VERSION: Final = 2
"""Part of the identity of the peers' rows; 2: cut into parts, the PSF no longer mirrored twice."""
DEFAULT_METHODS: Final = ("input", *CLASSICAL, "bank")
"""Rows of every comparison; the sizes of the networks follow them. Other peers are asked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rival:
    """Another bundle of the same camera to compare with."""

    bundle: Bundle
    label: str

    @property
    def size(self) -> str:
        """Return the size that is compared: M, or the only one there is."""
        sizes = self.bundle.manifest.sizes
        if "M" in sizes or len(sizes) == 1:
            return "M" if "M" in sizes else sizes[0]
        raise ContractError(
            f"{self.bundle.path.name} holds sizes {', '.join(sizes) or 'none'}; a bundle to "
            "compare with needs M or one size only"
        )


def make_rows(
    bundle: Bundle,
    methods: Sequence[str],
    rivals: Sequence[Rival],
    tuned: Tuned,
    isos: Sequence[float],
    lens: str,
    earlier: Bundle | None = None,
) -> list[Row]:
    """Make the rows in the order of the tables.

    Args:
        bundle: The camera.
        methods: Names of `DEFAULT_METHODS`, of sizes, or bank_rl and bank_admm_tv.
        rivals: Further bundles.
        tuned: Parameters of the classical peers.
        isos: Sensitivities that parameters are needed for.
        lens: Text of the prescription, part of what decides a measurement.
        earlier: The bundle as it was: its bank and networks become rows beside those of today.

    Raises:
        ContractError: If a name is unknown, a parameter is not tuned or another bundle is not of
            this camera.
    """
    base = identity_of(
        PROTOCOL_VERSION,
        bundle.manifest.sensor.model_dump_json(),
        bundle.manifest.members[PSF].sha256,
        lens,
    )
    rows = [_row(bundle, name, tuned, isos, base) for name in methods]
    if earlier is not None:
        check_camera(earlier, bundle)
        old = [n for n in methods if n in BANK_METHODS or n in earlier.manifest.sizes]
        earlier_rows = (
            _row(earlier, name, tuned, isos, identity_of(base, EARLIER)) for name in old
        )
        rows += [replace(row, name=row.name + EARLIER) for row in earlier_rows]
    for rival in rivals:
        check_camera(rival.bundle, bundle)
        rows.append(
            Row(
                name=rival.label,
                restore=bundle_restorer(rival.bundle, size=rival.size),
                identity=identity_of(base, *_network_parts(rival.bundle, rival.size)),
            )
        )
    return rows


def check_camera(other: Bundle, bundle: Bundle) -> None:
    """Refuse two bundles that are not of one camera.

    Raises:
        ContractError: If their sensors differ.
    """
    if other.manifest.sensor != bundle.manifest.sensor:
        raise ContractError(
            f"{other.path.name} is another camera than {bundle.path.name}; compare bundles of one "
            "camera"
        )


def _row(bundle: Bundle, name: str, tuned: Tuned, isos: Sequence[float], base: str) -> Row:
    if name == "input":
        return Row(name=name, restore=_developer(bundle), identity=identity_of(base, name))
    if name in PEERS:
        values = tuned.get(name, {})
        if missing := [f"{iso:g}" for iso in isos if iso not in values]:
            raise ContractError(
                f"{name} is not tuned for ISO {', '.join(missing)}; run with --tune first"
            )
        return Row(
            name=name,
            restore=_peer_restorer(bundle, name, values),
            identity=identity_of(base, PEER_VERSION, tuned_to_json({name: values})),
        )
    if name in BANK_METHODS:
        return Row(
            name=name,
            restore=bundle_restorer(bundle, method=BANK_METHODS[name]),
            identity=identity_of(base, name, _stage_json(bundle, Wiener)),
        )
    if name in bundle.manifest.sizes:
        return Row(
            name=name,
            restore=bundle_restorer(bundle, size=name),
            identity=identity_of(base, *_network_parts(bundle, name)),
        )
    names = (*("input", *PEERS, *BANK_METHODS), *bundle.manifest.sizes)
    raise ContractError(f"methods are {', '.join(names)}; got {name!r}")


def _developer(bundle: Bundle) -> Restorer:
    def restore(capture: Photograph) -> FloatArray:
        return finish_planes(capture.local.planes, capture, bundle)

    return restore


def _peer_restorer(bundle: Bundle, name: str, values: dict[float, Setting]) -> Restorer:
    def restore(capture: Photograph) -> FloatArray:
        planes = PEERS[name].restore(capture.local, values[capture.simulation.iso])
        return finish_planes(planes, capture, bundle)

    return restore


def _network_parts(bundle: Bundle, size: str) -> tuple[object, ...]:
    members = bundle.manifest.members
    return (
        members[PSF].sha256,
        *(members[sizes[size].member].sha256 for sizes in bundle.manifest.networks.values()),
        _stage_json(bundle, Wiener),
        _stage_json(bundle, Network),
    )


def _stage_json(bundle: Bundle, stage_type: type[Wiener] | type[Network]) -> str | None:
    stages = [stage.model_dump_json() for stage in bundle.manifest.stages_of(stage_type)]
    return "\n".join(stages) or None


def protocol_text(bundle: Bundle, isos: Sequence[float]) -> list[str]:
    """Return in sentences how the captures are made and judged."""
    psf, sensor = bundle.psf, color_sensor(bundle)
    fields, waves = psf.field_heights_mm.size, psf.wavelengths_um.size
    corner_mm = np.hypot(sensor.width_px, sensor.height_px) / 2 * sensor.pixel_pitch_um / 1000
    shares = ", ".join(f"{share:g}" for share in FIELD_SHARES)
    seeds = ", ".join(map(str, FABRICATION_SEEDS))
    part_px, overlap_px = part_sides(psf.kernels.shape[-1])
    where = f"Pictures lie at {depth_name(bundle.reference_depth_mm)}; methods have the mean kernel"
    depths = [f"{where} of {psf.depths_mm.size} depths."] if psf.depths_mm.size > 1 else []
    return [
        *depths,
        f"Each picture (sRGB decoded to linear light) is a crop of the {sensor.width_px} x "
        f"{sensor.height_px} sensor at {len(FIELD_SHARES)} places: {shares} of the way from "
        f"centred to touching a corner ({corner_mm:.1f} mm from the axis); picture i of a set "
        "takes corner i mod 4.",
        f"ISO {', '.join(f'{iso:g}' for iso in isos)}; mosaic, shot and read noise, saturation "
        "and quantisation as `camkit simulate` makes them.",
        f"Fabricated lenses: radius +-0.2 %, thickness +-0.03 mm, index +-0.0005, uniform, seeds "
        f"{seeds}; focused at assembly to +-0.02 mm; picture i takes seed i mod "
        f"{len(FABRICATION_SEEDS)}. Their PSFs are traced afresh at {2 * fields - 1} field heights "
        f"and {3 * waves - 2} wavelengths (the bundle's frozen PSF has {fields} and {waves}). "
        "Methods know the bundle's PSF only. No seed was used in training or tuning.",
        f"PSNR and SSIM (Gaussian weights) on sRGB values, in sensor geometry, vignetting divided "
        f"out, {BORDER_PX} pixels cut at every border.",
        f"The three classical methods get linear white-balanced demosaicked planes, cut into parts "
        f"of {part_px} px with {overlap_px} px overlap, mirrored past the borders of the picture; "
        "every part is tapered and restored with the bundle's PSF at its middle for each colour; "
        "nothing is clipped. Richardson-Lucy is scikit-image's round for round, on transforms that "
        "are made once. scikit-image has no ADMM-TV: that one is camkit's own.",
    ]
