"""A .zmx file (its sequential, centred, refracting part) as a `Lens`."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from camkit.bundle.states.lens_state import usual_note
from camkit.errors import CamkitError, ContractError, DecodeError, UnsupportedError
from camkit.models_def.optics.glass.catalogue import (
    AIR,
    FORMER,
    GlassCatalogue,
    own_glass,
)
from camkit.models_def.optics.glass.encoding import read_text
from camkit.models_def.optics.lens_file.placing import with_object_na
from camkit.models_def.optics.lens_file.states import named_state, with_states
from camkit.models_def.optics.lens_file.wavelength_weights import weighted_waves
from camkit.models_def.optics.lens_file.zmx_collimator import without_collimator
from camkit.models_def.optics.lens_file.zmx_completion import (
    APERTURES,
    completed,
    needs_focus,
)
from camkit.models_def.optics.lens_file.zmx_configurations import ZmxStates, split_states
from camkit.models_def.optics.lens_file.zmx_field import with_fields
from camkit.models_def.optics.lens_file.zmx_glass import (
    GlassOrder,
    GlassRule,
    glass_note,
    glass_order,
)
from camkit.models_def.optics.lens_file.zmx_records import (
    Record,
    Records,
    ZmxRecords,
    last,
    parse_records,
)
from camkit.models_def.optics.lens_file.zmx_surface import (
    SurfaceContext,
    medium_after,
    read_surface,
    refuse_unsupported,
)
from camkit.models_def.optics.paraxial import (
    paraxial_image,
    widest_stop_mm,
    with_paraxial_focus,
)
from camkit.models_def.optics.prescription import ApertureKind, Lens, Surface

_MM_PER_UNIT: Final = {"MM": 1.0, "CM": 10.0, "IN": 25.4, "METER": 1000.0, "M": 1000.0}
_DEFAULT_WAVE: Final = (0.55, 1.0)
_NORMAL_AIR: Final = (20.0, 1.0)
_VIGNETTING: Final = ("VDXN", "VDYN", "VCXN", "VCYN")


@dataclass(frozen=True, slots=True, kw_only=True)
class ZmxLens:
    """A lens and what of its file it does not carry.

    Attributes:
        lens: The lens.
        notes: For people, one line each.
    """

    lens: Lens
    notes: tuple[str, ...]


def read_zmx(
    path: Path,
    catalogues: Sequence[GlassCatalogue] = (),
    rule: GlassRule = "nearest",
    preferred: Sequence[GlassCatalogue] = (),
    *,
    choice: str | int | None = None,
    every: bool = False,
) -> ZmxLens:
    """Read a lens from a .zmx file, in one of its configurations.

    Args:
        path: UTF-16, UTF-8 or latin-1.
        catalogues: Of the user; asked for glasses before those of the GCAT line.
        rule: For glasses whose line states numbers beside the name.
        preferred: Catalogues of camkit that are asked before those of the GCAT line.
        choice: Number of a configuration; None for the one that the file shows.
        every: Whether all are read, as configurations of the lens.

    Raises:
        DecodeError: If the file is damaged; the message gives the line.
        UnsupportedError: If it holds what camkit does not trace; the message names it.
        ContractError: If a glass is unknown or the lens makes no sense.
    """
    text = read_text(path)
    try:
        return parse_zmx(
            text, catalogues, rule, preferred, name=path.stem, choice=choice, every=every
        )
    except CamkitError as error:
        raise type(error)(f"{path.name}: {error}") from error


def parse_zmx(
    text: str,
    catalogues: Sequence[GlassCatalogue] = (),
    rule: GlassRule = "nearest",
    preferred: Sequence[GlassCatalogue] = (),
    *,
    name: str = "lens",
    choice: str | int | None = None,
    every: bool = False,
) -> ZmxLens:
    """Read a lens from the text of a .zmx file; see `read_zmx`."""
    records, states = split_states(parse_records(text))

    def read(number: str) -> tuple[Lens, tuple[str, ...]]:
        return _read(states.files.get(number, records), catalogues, rule, preferred, name)

    if every and states.files:
        return _with_states(states, read)
    number = states.number(choice)
    lens, notes = read(number)
    if states.files:
        lens = named_state(lens, number)
        notes += () if choice is not None else (usual_note(list(states.files), number),)
    return ZmxLens(lens=lens, notes=(*notes, *states.notes))


def _with_states(states: ZmxStates, read: Callable[[str], tuple[Lens, tuple[str, ...]]]) -> ZmxLens:
    """Return the lens in its current configuration, and all that can be read as states."""
    lens, notes = read(states.current)
    lenses = {states.current: lens}
    notes += states.notes
    for number in (n for n in states.files if n != states.current):
        try:
            other, remarks = read(number)
        except CamkitError as error:
            notes += (f"configuration {number} left out: {error}",)
            continue
        if (len(other.surfaces), other.stop) != (len(lens.surfaces), lens.stop):
            notes += (f"configuration {number} left out: its stop or surfaces are others",)
            continue
        lenses[number] = other
        notes += tuple(f"configuration {number}: {note}" for note in remarks if note not in notes)
    ordered = {number: lenses[number] for number in states.files if number in lenses}
    return ZmxLens(lens=with_states(lens, ordered, states.current), notes=notes)


def _read(
    records: ZmxRecords,
    catalogues: Sequence[GlassCatalogue],
    rule: GlassRule,
    preferred: Sequence[GlassCatalogue],
    name: str,
) -> tuple[Lens, tuple[str, ...]]:
    """Return the lens of a file without configurations, and notes."""
    unit = last(records.system, "UNIT")
    scale = _mm_per_unit(unit)
    notes: tuple[str, ...] = () if unit is None or scale == 1 else (_unit_note(unit, scale),)
    records, completion_notes = completed(records, scale)
    records, collimator_notes = without_collimator(records)
    system = records.system
    mode = last(system, "MODE")
    if mode is not None and mode.words[:1] not in {(), ("SEQ",)}:
        raise UnsupportedError(f"line {mode.line}: MODE {mode.text}; camkit reads MODE SEQ")
    object_mm = _object_distance_mm(records, scale)
    gcat = last(system, "GCAT")
    order = glass_order(gcat.words if gcat else (), catalogues, rule, preferred)
    surfaces = tuple(
        read_surface(block, SurfaceContext(number=i, mm_per_unit=scale, order=order))
        for i, block in enumerate(records.surfaces[1:-1], start=1)
    )
    image_notes = _image_notes(records, surfaces[-1])
    object_context = SurfaceContext(number=0, mm_per_unit=scale, order=order)
    object_glass = medium_after(records.surfaces[0], object_context)
    stop = _stop(records)
    waves, reference, wave_notes = _wavelengths(system)
    title = last(system, "NAME")
    kind, value = _aperture(records, stop, scale, object_mm)
    lens = Lens(
        name=(title.text.strip() if title else "") or name,
        note="\n".join(record.text[2:] for record in system.get("NOTE", []) if record.text[2:]),
        surfaces=surfaces,
        stop=stop,
        aperture_kind=kind,
        aperture_value=value,
        object_distance_mm=object_mm,
        object_glass=object_glass.name,
        object_material=own_glass(object_glass, order.user_catalogues),
        wavelengths_um=waves,
        reference_wavelength_um=reference,
    )
    lens = _with_object_aperture(lens, system)
    lens, aperture_notes = _with_rim_aperture(lens, records, scale)
    lens, focus_notes = _with_image_distance(lens, records)
    notes += (*completion_notes, *collimator_notes, *aperture_notes, *focus_notes, *image_notes)
    notes += _notes(records, surfaces)
    notes += _glass_notes(records, surfaces, order)
    lens, field_notes = with_fields(lens, system, scale)
    return lens, (*notes, *wave_notes, *field_notes)


def _mm_per_unit(record: Record | None) -> float:
    name = record.words[0].upper() if record and record.words else "MM"
    if name not in _MM_PER_UNIT:
        raise DecodeError(f"UNIT must be one of {', '.join(_MM_PER_UNIT)}; got {name[:40]}")
    return _MM_PER_UNIT[name]


def _unit_note(unit: Record, scale: float) -> str:
    return f"lengths of the file are in {unit.words[0]}: {scale:g} mm each"


def _object_distance_mm(records: ZmxRecords, scale: float) -> float:
    block = records.surfaces[0]
    refuse_unsupported(block, 0)
    curvature, distance = last(block, "CURV"), last(block, "DISZ")
    if curvature is not None and curvature.number(0) != 0:
        raise UnsupportedError(f"line {curvature.line}: the object is curved; camkit has it flat")
    if distance is None or distance.words[:1] == ("INFINITY",):
        return math.inf
    value = distance.number(0)
    if abs(value) >= 1e10:  # what programs without infinity write
        return math.inf
    if value <= 0:
        raise UnsupportedError(
            f"line {distance.line}: the object lies {value:g} in front of the lens; "
            "camkit needs it at a positive distance"
        )
    return value * scale


def _image_notes(records: ZmxRecords, back: Surface) -> tuple[str, ...]:
    """Return a note on the medium behind the image, where light has ended.

    Raises:
        UnsupportedError: If the image is curved or not round.
        DecodeError: If the medium begins there: a lens of which the rest is missing.
    """
    block, number = records.surfaces[-1], len(records.surfaces) - 1
    refuse_unsupported(block, number)
    curvature, glass = last(block, "CURV"), last(block, "GLAS")
    if curvature is not None and curvature.number(0) != 0:
        raise UnsupportedError(
            f"line {curvature.line}: the last surface is the image, and curved; a sensor is flat "
            "(or the file is cut off)"
        )
    if glass is None:
        return ()
    last_medium = last(records.surfaces[-2], "GLAS")
    if last_medium is None or last_medium.words != glass.words:
        raise DecodeError(
            f"surface {number}, the last, has a glass that does not begin before it; "
            "is the file cut off?"
        )
    return (f"line {glass.line}: the image lies in {back.glass}: light ends there",)


def _stop(records: ZmxRecords) -> int:
    stops = [i for i, block in enumerate(records.surfaces) if "STOP" in block]
    if len(stops) != 1 or not 1 <= stops[0] < len(records.surfaces) - 1:
        raise DecodeError(f"one surface of the lens must hold STOP; got {stops or 'none'}")
    return stops[0] - 1


def _aperture(
    records: ZmxRecords, stop: int, scale: float, object_mm: float
) -> tuple[ApertureKind, float]:
    """Return the aperture; that of OBNA is put in later, when the entrance pupil is known."""
    apertures = [r for key in APERTURES if (r := last(records.system, key)) is not None]
    if len(apertures) != 1:
        keys = ", ".join(record.key for record in apertures) or "none"
        raise DecodeError(f"the aperture must be one of {', '.join(APERTURES)}; got {keys}")
    record = apertures[0]
    if record.key == "FLOA":
        size_mm = _stop_size_mm(records, stop, scale)
        return "stop_semi_diameter_mm", 1.0 if size_mm is None else size_mm
    if not record.number(0) > 0:
        raise DecodeError(f"line {record.line}: {record.key} must be > 0; got {record.text}")
    if record.key == "ENPD":
        return "entrance_pupil_diameter_mm", record.number(0) * scale
    if record.key == "OBNA":
        return "entrance_pupil_diameter_mm", 1.0
    if record.number(1, 0.0) != 0 and math.isfinite(object_mm):
        raise UnsupportedError(
            f"line {record.line}: a working f-number of a near object; give the entrance pupil"
        )
    return "f_number", record.number(0)


def _stop_size_mm(records: ZmxRecords, stop: int, scale: float) -> float | None:
    """Return what the file states of the stop's semi-diameter."""
    size = last(records.surfaces[stop + 1], "DIAM")
    return size.number(0) * scale if size is not None and size.number(0) > 0 else None


def _with_rim_aperture(lens: Lens, records: ZmxRecords, scale: float) -> tuple[Lens, list[str]]:
    """Return a lens whose file leaves the size of the stop to the rims, and a note of it."""
    record = last(records.system, "FLOA")
    if record is None or _stop_size_mm(records, lens.stop, scale) is not None:
        return lens, []
    semi_mm = widest_stop_mm(lens)
    if math.isinf(semi_mm):
        raise DecodeError(
            f"line {record.line}: FLOA needs the stop's DIAM, or fixed rims of other surfaces; "
            "got neither"
        )
    note = (
        f"line {record.line}: FLOA, and the stop has no DIAM: {semi_mm:.4g} mm, the widest that "
        "the other rims let the axis see"
    )
    return replace(lens, aperture_value=semi_mm), [note]


def _with_image_distance(lens: Lens, records: ZmxRecords) -> tuple[Lens, tuple[str, ...]]:
    """Return a list of surfaces without a way to the image focused where it has a real one."""
    if not needs_focus(records):
        return lens, ()
    distance_mm = paraxial_image(lens).distance_mm
    if not distance_mm > 0:
        return lens, (f"the paraxial image lies {-distance_mm:.4g} mm in front of the last vertex",)
    note = f"the last surface states no distance: the sensor is at the focus, {distance_mm:.4g} mm"
    return with_paraxial_focus(lens), (note,)


def _with_object_aperture(lens: Lens, system: Records) -> Lens:
    record = last(system, "OBNA")
    if record is None:
        return lens
    if record.number(1, 0.0) != 0:
        raise UnsupportedError(f"line {record.line}: OBNA given as an angle; give it as NA")
    try:
        return with_object_na(lens, record.number(0))
    except ContractError as error:
        raise DecodeError(f"line {record.line}: OBNA: {error}") from error


def _wavelengths(system: Records) -> tuple[tuple[float, ...], float, tuple[str, ...]]:
    """Return the wavelengths in um, increasing, each once, the primary one, and notes."""
    entries = [*system.get("WAVM", []), *system.get("WAVE", [])]
    listed = [(r.number(1), r.number(2, 1.0)) for r in sorted(entries, key=lambda r: r.number(0))]
    old = last(system, "WAVL")
    if not listed and old is not None:
        listed = [(value, 1.0) for value in old.numbers()]
    if not listed:
        raise DecodeError("the file states no wavelength (WAVM, WAVE or WAVL)")
    kind, primary = last(system, "FTYP"), last(system, "PWAV")
    position = int(primary.number(0)) if primary else 1
    count = int(kind.number(3, 0.0)) if kind else 0
    if 0 < count <= len(listed):
        listed = listed[:count]
    else:
        # without a count: programs fill the rest of their table with 0.55 um
        while len(listed) > max(position, 1) and listed[-1] == _DEFAULT_WAVE:
            listed.pop()
    if not 1 <= position <= len(listed):
        raise DecodeError(f"PWAV must be one of {len(listed)} wavelengths; got {position}")
    weights: dict[float, float] = {}
    for wave, weight in listed:
        weights[wave] = weights.get(wave, 0.0) + weight
    waves, notes = weighted_waves(weights)
    return waves, listed[position - 1][0], notes


def _notes(records: ZmxRecords, surfaces: tuple[Surface, ...]) -> tuple[str, ...]:
    notes = []
    for key in _VIGNETTING:
        record = last(records.system, key)
        if record is not None and any(record.numbers()):
            notes.append(
                f"line {record.line}: vignetting factors {key} left out: only fixed "
                "semi-diameters and apertures vignette"
            )
    air = last(records.system, "ENVD")
    if (
        air is not None
        and air.number(2, 0.0) != 0
        and (air.number(0), air.number(1)) != _NORMAL_AIR
    ):
        notes.append(
            f"line {air.line}: {air.number(0):g} degrees C and {air.number(1):g} atm left out: "
            "indices are relative to air at 20 degrees C and 1 atm"
        )
    gaps = [i for i, s in enumerate(surfaces, start=1) if s.thickness_mm < 0]
    if gaps:
        notes.append(f"surfaces {gaps} have negative thickness: kept")
    return tuple(notes)


def _glass_notes(
    records: ZmxRecords, surfaces: tuple[Surface, ...], order: GlassOrder
) -> tuple[str, ...]:
    """Return notes on glasses: once for each.

    Said are those whose name and numbers disagree, and those of a catalogue that GCAT leaves out.
    """
    catalogues = {c.name for c in (*order.user_catalogues, *order.listed)}
    catalogues = {name for name in catalogues if name.casefold() not in FORMER}
    notes: dict[str, str] = {}
    for block, surface in zip(records.surfaces[1:-1], surfaces, strict=True):
        glass = last(block, "GLAS")
        if glass is None or not glass.words or surface.glass == AIR.name:
            continue
        note = glass_note(glass, order, surface.medium)
        name, _, catalogue = surface.glass.rpartition("-")
        is_strange = ":" not in surface.glass and name and catalogue not in catalogues
        if note is None and is_strange and glass.words[0].upper() == name.upper():
            note = f"{name} is read as {surface.glass}"
        if note is not None:
            notes.setdefault(note, f"line {glass.line}: {note}")
    return tuple(notes.values())
