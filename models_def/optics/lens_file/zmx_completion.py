"""The parts of a .zmx file that it leaves out: object, image, wavelengths, stop, aperture.

Lists of the surfaces of a patent or of an old eyepiece are written in this format by programs that
know nothing of a system: no object, no image, no wavelengths, no stop. An attachment without a
diaphragm has no stop either. Each part is completed by a record, and each assumption is a note.
"""

from dataclasses import replace
from typing import Final

from camkit.models_def.optics.glass.dispersion import C_LINE_UM, D_LINE_UM, F_LINE_UM
from camkit.models_def.optics.lens_file.zmx_records import Record, Records, ZmxRecords, last

SIZED_APERTURES: Final = ("ENPD", "FNUM", "OBNA")
"""Those whose size stands in their line; FLOA takes that of the stop."""
APERTURES: Final = (*SIZED_APERTURES, "FLOA")
WAVELENGTHS: Final = ("WAVM", "WAVE", "WAVL")
_ASSUMED_LINE: Final = 0
_SYSTEM: Final = (*APERTURES, *WAVELENGTHS, "FTYP")


def completed(records: ZmxRecords, mm_per_unit: float) -> tuple[ZmxRecords, tuple[str, ...]]:
    """Return a file with what it leaves out, and a note of each assumption.

    Args:
        records: The file.
        mm_per_unit: Length unit of the file.

    Returns:
        The file and its notes; one that leaves nothing out comes back as it is.
    """
    notes: list[str] = []
    if not any(key in records.system for key in _SYSTEM):
        records = _with_system(records, notes)
    records = _with_stop(records, notes, mm_per_unit)
    return _with_aperture(records, notes, mm_per_unit), tuple(notes)


def needs_focus(records: ZmxRecords) -> bool:
    """Return whether the last surface of a list of surfaces states no way to the image."""
    primary, distance = last(records.system, "PWAV"), last(records.surfaces[-2], "DISZ")
    is_list = primary is not None and primary.line == _ASSUMED_LINE
    return is_list and (distance is None or distance.number(0) == 0)


def _with_system(records: ZmxRecords, notes: list[str]) -> ZmxRecords:
    """Return a list of surfaces with an object in front, an image behind, and wavelengths."""
    surfaces = records.surfaces
    if _is_lens_surface(surfaces[0]):
        surfaces = ({}, *surfaces)
    if _is_lens_surface(surfaces[-1]) or "GLAS" in surfaces[-2]:
        surfaces = (*surfaces, {})
    if surfaces[-1] and surfaces[0]:
        return records
    waves = [
        _record("WAVM", str(number), repr(wave), "1")
        for number, wave in enumerate((F_LINE_UM, D_LINE_UM, C_LINE_UM), start=1)
    ]
    system = {**records.system, "WAVM": waves, "PWAV": [_record("PWAV", "2")]}
    notes.append(
        "a list of surfaces without object, image and wavelengths: the object is at infinity, "
        "the wavelengths are the lines F, d and C"
    )
    return ZmxRecords(system=system, surfaces=surfaces)


def _is_lens_surface(block: Records) -> bool:
    """Return whether a surface does what neither an object nor an image does."""
    curvature = last(block, "CURV")
    gap = last(block, "DISZ")
    is_curved = curvature is not None and curvature.number(0) != 0
    leads_on = gap is not None and gap.words[:1] != ("INFINITY",) and gap.number(0) != 0
    return "GLAS" in block or is_curved or ("DIAM" in block and leads_on)


def _with_stop(records: ZmxRecords, notes: list[str], mm_per_unit: float) -> ZmxRecords:
    """Return a file whose stop, where it names none, is the surface of least clear radius."""
    if any("STOP" in block for block in records.surfaces):
        return records
    sizes = {i: _clear_radius(block) for i, block in enumerate(records.surfaces[1:-1], start=1)}
    radii = {i: size for i, size in sizes.items() if size > 0}
    number = min(radii, key=lambda i: radii[i]) if radii else 1
    blocks = list(records.surfaces)
    blocks[number] = {**blocks[number], "STOP": [_record("STOP")]}
    why = (
        f"the one of least clear radius ({radii[number] * mm_per_unit:g} mm)"
        if radii
        else "the first one, since none states a clear radius"
    )
    notes.append(f"no surface holds STOP: surface {number} is taken, {why}")
    return replace(records, surfaces=tuple(blocks))


def _with_aperture(records: ZmxRecords, notes: list[str], mm_per_unit: float) -> ZmxRecords:
    """Return a file that states no aperture opened to the clear radius of its stop."""
    stops = [block for block in records.surfaces if "STOP" in block]
    if any(key in records.system for key in APERTURES) or len(stops) != 1:
        return records
    radius = _clear_radius(stops[0])
    if not radius > 0:
        return records
    size = f"{radius * mm_per_unit:g} mm"
    notes.append(f"no aperture: the stop is open to its clear radius ({size})")
    return replace(records, system={**records.system, "FLOA": [_record("FLOA")]})


def _clear_radius(block: Records) -> float:
    """Return the semi-diameter in units of the file; 0 where there is none."""
    diameter = last(block, "DIAM")
    return diameter.number(0) if diameter is not None and diameter.words else 0.0


def _record(key: str, *words: str) -> Record:
    return Record(line=_ASSUMED_LINE, key=key, words=words, text=" ".join(words))
