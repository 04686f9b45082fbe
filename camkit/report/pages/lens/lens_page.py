"""The page of a lens, and its charts beside it."""

import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Final

from camkit.models_def.optics.analysis.seidel import SEIDEL_NAMES, Seidel
from camkit.models_def.optics.prescription import Surface, grooves_of
from camkit.models_def.optics.shape.phase import Phase, monomial_name
from camkit.report.pages.lens.fan_charts import draw_opd_fans, draw_ray_fans
from camkit.report.pages.lens.image_charts import draw_encircled, draw_psfs
from camkit.report.pages.lens.layout import draw_layout
from camkit.report.pages.lens.lens_charts import (
    draw_colour,
    draw_field,
    draw_mtf,
    draw_seidel,
)
from camkit.report.pages.lens.lens_facts import LensFacts
from camkit.report.pages.lens.lens_image import SHARES
from camkit.report.pages.lens.spot_charts import OtherLens, draw_spots
from camkit.report.pages.page import Cell, Page, Part, Picture, Section, Table, Words, write_page
from camkit.units import UM_PER_MM, to_degrees

_PUPILS: Final = {
    "paraxial": "paraxial: rays fill the paraxial entrance pupil",
    "chief": "chief: the chief ray is aimed at the middle of the stop, around it rays fill a disc "
    "of the entrance pupil's diameter",
    "stop": "stop: every ray is aimed at its point of the stop, whose radius is that of the real "
    "marginal ray",
}
_CHARTS: Final = {
    "layout": draw_layout,
    "spots": draw_spots,
    "psf": draw_psfs,
    "encircled": draw_encircled,
    "mtf": draw_mtf,
    "rayfans": draw_ray_fans,
    "opdfans": draw_opd_fans,
    "field": draw_field,
    "colour": draw_colour,
    "seidel": draw_seidel,
}
_CAPTIONS: Final = {
    "layout": "Rays of the reference wavelength; of many fields, five.",
    "mtf": "Tangential: lines across the meridian; sagittal: along it. Of many fields, five.",
    "spots": "About the chief ray of the reference wavelength, all fields to one scale; circle: "
    "Airy disc. RMS about the centroid at the wavelength of the file nearest to the reference, "
    "and of all wavelengths, with equal weight, about their common centroid.",
    "field": "T tangential (solid), S sagittal (dashed) focus of close rays. Distortion against "
    "the paraxial chief ray on the sensor. Light is traced with every ray aimed at the stop.",
    "psf": "The image of a point about the chief ray of the reference wavelength, all wavelengths "
    "with equal weight, to one scale; brightness is the root of the light, each picture to its "
    "own peak. Strehl ratio at the wavelength nearest to the reference. Of many fields, five.",
    "encircled": "Light within circles about the centroid. By waves it is the share of all light "
    "that passes the lens; by rays diffraction is left out. Of many fields, five.",
    "rayfans": "Where rays land from the chief ray of the reference wavelength: y of a fan in the "
    "meridional plane (tangential), x of a fan across it (sagittal). Gaps are lost rays.",
    "opdfans": "Optical path difference against the chief ray of the wavelength, in its waves; "
    "longer paths are negative.",
    "colour": "",
    "seidel": "S = 2|n'u'| times the transverse third-order aberration: negative S_I is "
    "undercorrected, negative S_V barrel distortion; Welford's sums are the negatives.",
}
_PRESCRIPTION: Final = (
    *("surface", "radius, mm", "thickness, mm", "glass", "semi-diameter, mm", "conic"),
    "r², r⁴, …",
)
_STATES: Final = (
    *("configuration", "EFL, mm", "f-number", "object distance, mm", "widest field"),
    *("RMS on the axis, µm", "RMS at the widest field, µm"),
)
_GROOVES: Final = (
    *("surface", "groove, µm", "walls", "narrowest, mm", "tool radius, µm", "grooves"),
)
_FIELDS: Final = (
    *(
        "field",
        "wavelength, µm",
        "chief height, mm",
        "RMS, µm",
        "RMS chief, µm",
        "max, µm",
        "Airy, µm",
    ),
    *("OPD RMS, waves", "Strehl", "distortion, %", "light", "rays lost"),
)
_BY_SAMPLING: Final = (
    "RMS radius in µm about the centroid, reference wavelength, by sampling of the pupil:"
)


def write_lens_page(
    facts: LensFacts, folder: Path, name: str, other: OtherLens | None = None
) -> list[Path]:
    """Write NAME.html, and NAME-CHART.svg and .png beside it; return the files, the page first.

    Args:
        facts: Of the lens.
        folder: For the files.
        name: NAME.
        other: A lens to draw the spots of as well.

    Raises:
        UnsupportedError: If matplotlib is not installed.
    """
    charts = {
        chart: partial(draw, facts)
        for chart, draw in _CHARTS.items()
        if chart != "seidel" or facts.seidel is not None
    }
    charts["spots"] = partial(draw_spots, facts, name, other)
    return write_page(folder, name, charts, partial(lens_page, facts))


def lens_page(facts: LensFacts, pictures: Mapping[str, str]) -> Page:
    """Return the page.

    Args:
        facts: Of the lens.
        pictures: Name -> SVG text.
    """
    lens = facts.lens
    charts = {name: Picture(_CAPTIONS[name], svg) for name, svg in pictures.items()}
    lead: list[Part] = [Words(lens.note, "small")] if lens.note else []
    lead += [_pupil_words(facts), *(Words(note, "note") for note in facts.notes)]
    spots = (charts.get("spots"), _fields(facts), Words(_BY_SAMPLING, "small"), _convergence(facts))
    sections = [
        Section("Layout", (charts.get("layout"),)),
        Section("First order", (_first_order(facts),)),
        *([Section("Configurations", (_states(facts),))] if facts.states else []),
        Section("Prescription", (_prescription(facts), _grooves(facts))),
        Section("Spot diagrams", (*spots, f"PSF: {facts.model.reason}.")),
        Section("Point images", (charts.get("psf"), charts.get("encircled"), _images(facts))),
        Section("MTF", (charts.get("mtf"),)),
        Section("Ray fans", (charts.get("rayfans"),)),
        Section("Optical path differences", (charts.get("opdfans"),)),
        Section("Field curvature, distortion, relative illumination", (charts.get("field"),)),
        Section("Longitudinal aberration and colour", (charts.get("colour"),)),
    ]
    if facts.seidel is not None:
        sums = (charts.get("seidel"), *_seidel(facts.seidel))
        sections.append(Section("Third-order sums by surface", sums))
    return Page(title=lens.name, lead=lead, sections=sections)


def _pupil_words(facts: LensFacts) -> str:
    real = facts.real_stop_mm
    radii = f"Stop radius {facts.paraxial.stop_semi_diameter_mm:.6g} mm by the paraxial marginal "
    radii += "ray" if real is None else f"ray, {real:.6g} mm by the real one"
    return (
        f"Pupil {_PUPILS[facts.pupil.definition]}. Taken because: "
        f"{facts.choice.definition_reason}. Sampling {facts.pupil.sampling} "
        f"({len(facts.pupil.samples.x)} rays per field and wavelength). Taken because: "
        f"{facts.choice.sampling_reason}. {radii}."
    )


def _first_order(facts: LensFacts) -> Table:
    data, lens = facts.paraxial, facts.lens
    sensor = lens.surfaces[-1].thickness_mm
    near = math.isfinite(lens.object_distance_mm)
    rows = [
        ("reference wavelength, µm", lens.reference_wavelength_um),
        ("object distance, mm", lens.object_distance_mm if near else math.inf),
        ("EFL, mm", data.efl_mm),
        ("BFL, mm", data.bfl_mm),
        ("FFL, mm", data.ffl_mm),
        ("f-number (EFL / entrance pupil)", data.f_number),
        ("total track to the sensor, mm", facts.total_track_mm),
        ("sensor beyond the paraxial focus of a distant object, mm", sensor - data.bfl_mm),
        ("entrance pupil from the first vertex, mm", data.entrance_pupil_mm),
        ("entrance pupil diameter, mm", data.entrance_pupil_diameter_mm),
        ("exit pupil from the last vertex, mm", data.exit_pupil_mm),
        ("exit pupil diameter, mm", data.exit_pupil_diameter_mm),
    ]
    return Table(rows=[(name, _number(value, 8)) for name, value in rows])


def _states(facts: LensFacts) -> Table:
    rows = [
        (
            f"{state.name} (default)" if state.is_usual else state.name,
            _number(state.efl_mm, 6),
            _number(state.f_number, 4),
            _number(state.object_distance_mm, 6),
            f"{to_degrees(state.widest_field_rad):.4g}°",
            _number(state.axis_spot_mm * UM_PER_MM, 4),
            _number(state.widest_spot_mm * UM_PER_MM, 4),
        )
        for state in facts.states
    ]
    return Table(header=_STATES, rows=rows)


def _prescription(facts: LensFacts) -> Table:
    rows = [
        (
            f"{number} (stop)" if number == facts.lens.stop else str(number),
            _number(surface.radius_mm, 8),
            _number(surface.thickness_mm, 8),
            surface.glass,
            _number(surface.semi_diameter_mm, 6),
            _number(surface.conic, 6) if surface.conic else "",
            _polynomial(surface),
        )
        for number, surface in enumerate(facts.lens.surfaces)
    ]
    return Table(header=_PRESCRIPTION, rows=rows)


def _polynomial(surface: Surface) -> str:
    """Return the polynomial part and the phase of a surface in words."""
    part = surface.asphere
    radius = part.normal_radius_mm
    rows = {
        "": part.even,
        "odd: ": part.odd,
        "Q_bfs: ": part.q_bfs,
        "Q_con: ": part.q_con,
    }
    texts = [name + ", ".join(_number(a, 6) for a in row) for name, row in rows.items() if row]
    if surface.phase is not None:
        texts.append(_phase_text(surface.phase))
    if radius is not None:
        texts.insert(0, f"of r / {radius:g} mm")
    if surface.stance is not None:
        decentre = " and ".join(f"{mm:g}" for mm in surface.stance.decentre_mm)
        tilt = " and ".join(f"{to_degrees(rad):.4g}" for rad in surface.stance.tilt_rad)
        texts.append(f"element decentred by {decentre} mm, tilted by {tilt} degrees (x and y)")
    return "; ".join(texts)


def _phase_text(phase: Phase) -> str:
    """Return the terms of a phase by name: r2, r4, then x3, x2y, ..."""
    terms = [(f"r{2 * i}", a) for i, a in enumerate(phase.radial_rad, start=1)]
    terms += [(monomial_name(m), m.coefficient_rad) for m in phase.free_rad]
    text = ", ".join(f"{name} {_number(rad, 6)}" for name, rad in terms)
    return f"phase (order {phase.order:g}, of lengths / {phase.radius_mm:g} mm), rad: {text}"


def _grooves(facts: LensFacts) -> Table | None:
    rows = [
        (
            str(g["surface"]),
            _number(g["groove_depth_um"], 6),
            str(g["walls"]),
            _number(math.nan if g["narrowest_mm"] is None else g["narrowest_mm"], 4),
            _number(g["tool_radius_um"], 4),
            "ideal" if g["ideal"] else "with walls",
        )
        for g in grooves_of(facts.lens)
    ]
    return Table(header=_GROOVES, rows=rows) if rows else None


def _images(facts: LensFacts) -> Table | None:
    """Return the radii of encircled energy of every field, and why some have no waves."""
    image = facts.image
    if image is None:
        return None
    rows: list[tuple[str | Cell, ...]] = []
    for i, angle_rad in enumerate(facts.lens.field_angles_rad):
        dark = facts.dark_reason(i)
        how = "" if dark else "rays" if image.images[i] is None else "waves"
        radii = (math.nan if dark else image.radius_mm(i, share) for share in SHARES)
        rows.append(
            (
                f"{to_degrees(angle_rad):.4g}°",
                *(_number(radius * UM_PER_MM, 4) for radius in radii),
                how,
                Cell(text=dark or image.reasons[i], look="words"),
            )
        )
    heads = (f"{share:.0%} of the light within, µm" for share in SHARES)
    return Table(header=("field", *heads, "by", "why not by waves"), rows=rows)


def _fields(facts: LensFacts) -> Table:
    rows, image = [], facts.image
    for i, angle_rad in enumerate(facts.lens.field_angles_rad):
        for j, wave in enumerate(facts.lens.wavelengths_um):
            losses = {name: n for name, n in facts.fates(i, j).items() if n and name != "valid"}
            spots = (facts.rms_mm, facts.rms_chief_mm, facts.max_mm)
            rows.append(
                (
                    f"{to_degrees(angle_rad):.4g}°",
                    f"{wave:.4g}",
                    _number(float(facts.chief_mm[i, j]), 5),
                    *(_number(float(v[i, j]) * UM_PER_MM, 5) for v in spots),
                    _number(float(facts.airy_mm[j]) * UM_PER_MM, 4),
                    _number(float(facts.wavefront_um[i, j]) / wave, 4),
                    _number(math.nan if image is None else float(image.strehl[i, j]), 4),
                    _number(100 * float(facts.distortion[i, j]), 4),
                    _number(float(facts.illumination[i, j]), 4),
                    ", ".join(f"{n} {name.replace('_', ' ')}" for name, n in losses.items()) or "0",
                )
            )
        if len(facts.wavelengths_um) > 1:
            rms = _number(float(facts.rms_all_mm[i]) * UM_PER_MM, 5)
            blank = [""] * (len(_FIELDS) - 4)
            rows.append((f"{to_degrees(angle_rad):.4g}°", "all", "", rms, *blank))
    return Table(header=_FIELDS, rows=rows)


def _convergence(facts: LensFacts) -> Table:
    convergence = facts.convergence
    angles = [f"{to_degrees(a):.4g}°" for a in facts.lens.field_angles_rad]
    rows = [
        (name, str(rays), *(_number(v * UM_PER_MM, 5) for v in rms))
        for name, rays, rms in zip(
            convergence.samplings, convergence.rays, convergence.rms_mm.tolist(), strict=True
        )
    ]
    return Table(header=("sampling", "rays", *angles), rows=rows)


def _seidel(sums: Seidel) -> list[Part]:
    colours = (sums.axial_colour_mm, sums.lateral_colour_mm)
    values = zip(sums.surfaces_mm.tolist(), *(c.tolist() for c in colours), strict=True)
    rows = [
        (str(number), *(_number(v, 5) for v in (*five, *two)))
        for number, (five, *two) in enumerate(values)
    ]
    total = [*sums.sums_mm.tolist(), *(float(c.sum()) for c in colours)]
    rows.append(("sum", *(_number(v, 6) for v in total)))
    transverse = sums.transverse_mm()
    return [
        Table(header=("surface", *SEIDEL_NAMES, "C_L", "C_T"), rows=rows),
        Words("Transverse, in mm (PTZ in 1/mm), as CODE V lists them:", "small"),
        Table(header=tuple(transverse), rows=[[_number(v, 5) for v in transverse.values()]]),
    ]


def _number(value: float, digits: int) -> str:
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "-∞"
    return f"{value + 0.0:.{digits}g}"  # no -0
