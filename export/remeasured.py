"""A copy of a bundle with parts that were measured: geometry, illumination, noise, kernels.

    FROM + what was measured -> sensor, optics, stages -> golden cases anew -> checked -> bundle

What was shown of FROM holds no more: its envelope, its plan, its card and its stress kernels
(and their haze) are left out; with other kernels also the design that they came from, and the
networks that were trained behind them.
"""

import tempfile
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.chain import rewired
from camkit.bundle.facts import Card
from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.manifest import Manifest, format_of, planes_of
from camkit.bundle.optics import FrozenPsfOptics, HazyPsfOptics, LensProfile, RadialEntry
from camkit.bundle.psf_file import psf_to_bytes
from camkit.bundle.reader import (
    CARD,
    GOLDEN,
    PLATE,
    PLATE_HEIGHTS,
    PRESCRIPTION,
    PREVIEW,
    STRESS_HAZE,
    STRESS_PSF,
    Bundle,
)
from camkit.bundle.sensor import BayerSensor, ChannelResponse, Extent, PlanesSensor
from camkit.bundle.stages import Illumination, Parts, Wiener
from camkit.bundle.writer import write_bundle
from camkit.calibration.measured_files import FlatFile, GeometryFile, NoiseFile
from camkit.calibration.psf_import.kernel_places import reach_note
from camkit.calibration.psf_import.kernel_resampling import with_pitch
from camkit.calibration.psf_import.own_colours import narrow_response
from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError
from camkit.export.golden_cases import add_outputs, photograph_all
from camkit.export.proving import golden_members, with_activations, write_proved
from camkit.haze import Haze
from camkit.psf import FrozenPsf
from camkit.radial import RadialDistortion
from camkit.runtime.geometry.distortion import RANGE_MARGIN, check_distortion
from camkit.units import to_mm

FloatGrid = NDArray[np.float64]
PITCH_TOLERANCE: Final = 0.02
LEAST_REACH: Final = 0.95
"""Of the way to the corner, which blocks of pictures never reach."""
OWN_NAMES: Final = (STRESS_PSF, STRESS_HAZE, CARD, PREVIEW, GOLDEN)
DESIGN: Final = (PRESCRIPTION, PLATE, PLATE_HEIGHTS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """New measurements; None for what was not measured.

    Attributes:
        geometry: Distortion and optical centre.
        flat: Relative illumination; its centre counts where no geometry states one.
        noise: Of the sensor.
        psf: Kernels of one place or many, at any pitch.
    """

    geometry: GeometryFile | None = None
    flat: FlatFile | None = None
    noise: NoiseFile | None = None
    psf: FrozenPsf | None = None


@dataclass(slots=True)
class _Draft:
    """A bundle in the making."""

    manifest: Manifest
    members: dict[str, bytes]
    psf: FrozenPsf | None
    haze: Haze | None = None
    notes: list[str] = field(default_factory=list)

    def change(self, **fields: Any) -> None:
        """Change fields of the manifest."""
        self.manifest = self.manifest.model_copy(update=fields)

    @property
    def sensor(self) -> BayerSensor | PlanesSensor:
        """Return the sensor."""
        sensor = self.manifest.sensor
        if not isinstance(sensor, BayerSensor | PlanesSensor):
            raise DecodeError(f"{self.manifest.name} counts photons; nothing of it is measured so")
        return sensor


def remeasured(
    bundle: Bundle, measured: Measured, out: Path, *, keep_networks: bool = False
) -> tuple[Bundle, tuple[str, ...]]:
    """Write a copy of a bundle with new measurements; return it, and notes for people.

    Args:
        bundle: What is copied.
        measured: What was measured, one part at least.
        out: The new bundle; its name is the camera's.
        keep_networks: Keep networks with other kernels.

    Raises:
        DecodeError: If a part does not fit the bundle.
        BundleError: If a reader would refuse the result.
        ParityError: If it fails its check; nothing is written then.
    """
    if measured == Measured():
        raise ContractError(
            f"nothing was measured: give {option_text('geometry')}, {option_text('flat')}, "
            f"{option_text('noise')} or {option_text('psf')}"
        )
    optics, name = bundle.manifest.optics, bundle.manifest.name
    if optics is None or bundle.manifest.sensor.extent is None:
        raise DecodeError(f"{name} states no optics or no size of its sensor, so no camera of it")
    if optics.type == "streaks" and measured != Measured(noise=measured.noise):
        raise DecodeError(
            f"the optics of {name} write streaks; only {option_text('noise')} can be put into it"
        )
    if optics.type == "lens_states" and measured != Measured(noise=measured.noise):
        raise DecodeError(
            f"{name} has several configurations; only {option_text('noise')} can be put into it"
        )
    hazy = optics.type == "hazy_psf"
    if hazy and measured.psf is not None:
        raise DecodeError(
            f"the haze of {name} belongs to its kernels; leave {option_text('psf')} out"
        )
    members = {name: bundle.member(name) for name in bundle.names if name not in OWN_NAMES}
    psf = bundle.psf if hazy or optics.type == "frozen_psf" else None
    haze = bundle.haze if hazy else None
    draft = _Draft(manifest=bundle.manifest, members=members, psf=psf, haze=haze)
    draft.change(golden=(), envelope=None, plan=None, card=Card())
    if measured.noise is not None:
        _put_noise(draft, measured.noise)
    if measured.psf is not None:
        _put_psf(draft, measured.psf, keep_networks=keep_networks)
    _put_centre(draft, measured)
    if measured.flat is not None:
        _put_flat(draft, measured.flat)
    if measured.geometry is not None:
        _put_geometry(draft, measured.geometry)
    _finish(draft)
    return _proved(draft, out), tuple(draft.notes)


def _put_noise(draft: _Draft, noise_file: NoiseFile) -> None:
    lowest = min(noise_file.iso, key=lambda one: one.iso)
    if any(not one.read_noise_resolved for one in noise_file.iso):
        draft.notes.append("read noise that was not resolved is taken as large as it may be")
    update = {
        "noise": noise_file.noise(),
        "full_well_e": lowest.full_well_e,
        "black_level": lowest.black_level,
        "white_level": lowest.white_level,
    }
    sensor = draft.sensor
    ends = {one.iso for one in sensor.noise}, {one.iso for one in noise_file.iso}
    if min(ends[0]) < min(ends[1]) or max(ends[0]) > max(ends[1]):
        earlier, now = (f"{min(isos):g} to {max(isos):g}" for isos in ends)
        draft.notes.append(f"noise is known at ISO {now} now, at {earlier} before")
    draft.change(sensor=type(sensor).model_validate({**sensor.model_dump(), **update}))


def _put_psf(draft: _Draft, psf: FrozenPsf, *, keep_networks: bool) -> None:
    sensor, earlier = draft.sensor, draft.psf
    if earlier is None or draft.manifest.stage(Wiener) is None:
        raise DecodeError(f"{draft.manifest.name} has no Wiener bank that would use kernels")
    pitch_um, stated_um = sensor.pixel_pitch_um, psf.pixel_pitch_um
    if abs(stated_um / pitch_um - 1) > PITCH_TOLERANCE:
        psf = with_pitch(psf, pitch_um)
        draft.notes.append(
            f"the kernels had samples of {stated_um:g} um and were resampled to {pitch_um:g} um, "
            "the pixels of the sensor"
        )
    extent = sensor.known_extent
    sides_mm = (to_mm(side * pitch_um) for side in (extent.width_px, extent.height_px))
    draft.notes += filter(None, [reach_note(psf, *sides_mm)])
    channels = len(sensor.channels)
    if psf.wavelengths_um.size not in (1, channels):
        raise DecodeError(
            f"the kernels have {psf.wavelengths_um.size} wavelengths, one for each of {channels} "
            "channels, or one for all, is expected, as `camkit calibrate psf` writes them"
        )
    light = _light_at(psf.field_heights_mm, earlier)
    if psf.symmetry == "uniform":
        draft.notes.append("kernels of one place hold no vignetting: light is not evened")
        _leave_out(draft, {Illumination})
    draft.psf = replace(
        psf,
        pixel_pitch_um=pitch_um,
        distortion=earlier.distortion,
        relative_illumination=light,
    )
    waves, rows = narrow_response(psf.wavelengths_um)
    if len(rows) < channels:
        rows = np.repeat(rows, channels, axis=0)
    response = ChannelResponse(
        wavelengths_um=tuple(waves.tolist()),
        response=tuple(map(tuple, rows.tolist())),
        source="one measured kernel for each colour",
    )
    draft.change(sensor=sensor.model_copy(update={"channel_response": response}), freeze={})
    draft.members = {name: data for name, data in draft.members.items() if name not in DESIGN}
    stages = tuple(
        stage.alone() if isinstance(stage, Wiener) else stage for stage in draft.manifest.stages
    )
    draft.change(stages=stages)
    if draft.manifest.networks and not keep_networks:
        draft.notes.append("the networks were trained behind other kernels and are left out")
        _leave_out_networks(draft)


def _light_at(heights_mm: FloatGrid, psf: FrozenPsf) -> FloatGrid:
    illumination = psf.radial_illumination
    if illumination is None:
        return np.ones(heights_mm.size)
    return np.asarray(np.interp(heights_mm**2, illumination.heights_mm**2, illumination.light))


def _leave_out(draft: _Draft, kinds: set[type]) -> None:
    stages = draft.manifest.stages
    remaining = [stage for stage in stages if type(stage) not in kinds]
    draft.change(stages=rewired(remaining, stages))


def _leave_out_networks(draft: _Draft) -> None:
    names = {
        name
        for sizes in draft.manifest.networks.values()
        for facts in sizes.values()
        for name in (facts.member, facts.fp16_member)
    }
    draft.members = {name: data for name, data in draft.members.items() if name not in names}
    stages = draft.manifest.stages
    remaining = [stage for stage in stages if stage.type != "network"]
    draft.change(stages=rewired(remaining, stages), networks={})


def _put_centre(draft: _Draft, measured: Measured) -> None:
    flat, geometry, extent = measured.flat, measured.geometry, draft.sensor.known_extent
    width, height = extent.width_px, extent.height_px
    for what, part in (("geometry", geometry), ("flat", flat)):
        size = None if part is None else (part.width_px, part.height_px)
        if size not in (None, (None, None), (width, height)):
            raise DecodeError(
                f"the {what} is of {size[0]}x{size[1]} px, the sensor has {width}x{height}"
            )
    if geometry is not None:
        centre = geometry.centre_px
    elif flat is not None and flat.centre_found:
        centre = flat.centre_px
    else:
        return
    if not (0 <= centre[0] <= width - 1 and 0 <= centre[1] <= height - 1):
        raise DecodeError(
            f"the optical centre ({centre[0]:g}, {centre[1]:g}) lies outside of the sensor of "
            f"{width}x{height} px"
        )
    extent = extent.model_copy(update={"optical_centre_px": centre})
    draft.change(sensor=draft.sensor.model_copy(update={"extent": extent}))


def _farthest_px(extent: Extent) -> float:
    """Return the distance of the farthest corner from the optical centre."""
    x, y = extent.axis_px
    return float(np.hypot(max(x, extent.width_px - 1 - x), max(y, extent.height_px - 1 - y)))


def _put_flat(draft: _Draft, flat: FlatFile) -> None:
    pitch_um, entry = draft.sensor.pixel_pitch_um, flat.to_entry()
    if abs(flat.pixel_pitch_um / pitch_um - 1) > PITCH_TOLERANCE:
        raise DecodeError(
            f"the flat was measured with pixels of {flat.pixel_pitch_um:g} um, the sensor has "
            f"{pitch_um:g} um"
        )
    if not flat.separated:
        draft.notes.append("the flat was not told from the display; what it has of it comes along")
    corner_mm = _farthest_px(draft.sensor.known_extent) * to_mm(pitch_um)
    if flat.heights_mm[-1] < LEAST_REACH * corner_mm:
        draft.notes.append(
            f"the flat is known to {flat.heights_mm[-1]:.3g} mm of {corner_mm:.3g} from the "
            "centre; beyond, light is taken to fall no further"
        )
    optics = draft.manifest.optics
    if isinstance(optics, LensProfile):
        draft.change(optics=optics.model_copy(update={"illumination": entry}))
        return
    assert draft.psf is not None
    if draft.psf.symmetry == "uniform":
        raise DecodeError(
            f"kernels of one place hold no vignetting; leave {option_text('flat')} out"
        )
    light = entry.to_illumination()
    values = np.interp(draft.psf.field_heights_mm**2, light.heights_mm**2, light.light)
    draft.psf = replace(draft.psf, relative_illumination=values)


def _put_geometry(draft: _Draft, geometry: GeometryFile) -> None:
    extent = draft.sensor.known_extent
    rows = (geometry.radial.coefficients,) * len(draft.sensor.channels)
    radius_mm = geometry.radial.radius_px * to_mm(extent.pixel_pitch_um)
    entry = RadialEntry(coefficients=rows, radius_mm=radius_mm)
    farthest = _farthest_px(extent)
    try:
        check_distortion(entry.to_distortion(), farthest * to_mm(extent.pixel_pitch_um))
    except ContractError as error:
        raise DecodeError(f"the geometry cannot be undone: {error}") from error
    if geometry.covered_radius_px * RANGE_MARGIN < farthest:
        reach = f"{geometry.covered_radius_px:.0f} px of {farthest:.0f}"
        draft.notes.append(f"the geometry is known to {reach} from the centre; the rest is guessed")
    optics = draft.manifest.optics
    if isinstance(optics, LensProfile):
        draft.change(optics=optics.model_copy(update={"distortion": entry}))
        return
    assert draft.psf is not None
    distortion = RadialDistortion(coefficients=np.array(rows), radius_mm=radius_mm)
    draft.psf = replace(draft.psf, distortion=distortion)


def _finish(draft: _Draft) -> None:
    """Update planes, products, optics and version to the parts."""
    manifest, optics = draft.manifest, draft.manifest.optics
    if draft.psf is not None and isinstance(optics, FrozenPsfOptics | HazyPsfOptics):
        draft.members[optics.member] = psf_to_bytes(draft.psf)
        focus_mm = optics.object_distance_mm
        frozen = FrozenOptics(psf=draft.psf, haze=draft.haze)
        entry = frozen.entry(np.inf if focus_mm is None else focus_mm)
        newest = format_of(draft.psf, (entry, *manifest.stages), least=manifest.version_pair)
        draft.change(optics=entry, format_version=newest)
    parts = Parts(
        sensor=draft.manifest.sensor,
        optics=draft.manifest.optics,
        networks=draft.manifest.networks,
    )
    stages = draft.manifest.stages
    draft.change(planes=planes_of(stages, parts), laws=None)  # of other parts than before
    planes = draft.manifest.all_planes
    products = {name: plane for name, plane in manifest.products.items() if plane in planes}
    draft.change(products={**products, "image": stages[-1].gives[0]})


def _proved(draft: _Draft, out: Path) -> Bundle:
    """Make golden cases, check the bundle, and write it."""
    if draft.manifest.has_kernels:
        with tempfile.TemporaryDirectory() as folder:
            trial = write_bundle(Path(folder) / out.name, draft.manifest, draft.members)
            cases = photograph_all(trial)
            draft.members |= golden_members(trial, add_outputs(trial, cases))
            draft.change(
                golden=tuple(case for case, _ in cases.values()),
                networks=with_activations(trial, cases),
            )
    bundle, _ = write_proved(out, draft.manifest, draft.members)
    return bundle
