"""The page of a lens; one file, no other needed."""

import math
import re
from collections.abc import Mapping, Sequence
from html import escape
from typing import Final

from camkit.models_def.optics.analysis.seidel import SEIDEL_NAMES
from camkit.models_def.optics.prescription import grooves_of
from camkit.report.lens.facts import LensFacts
from camkit.report.style import STYLE
from camkit.units import UM_PER_MM, to_degrees

TITLES: Final = {
    "layout": "Layout",
    "spots": "Spot diagrams",
    "mtf": "MTF",
    "field": "Field curvature, distortion, relative illumination",
    "colour": "Longitudinal aberration and colour",
    "seidel": "Third-order sums by surface",
}
_PUPILS: Final = {
    "paraxial": "paraxial: rays fill the paraxial entrance pupil",
    "chief": "chief: the chief ray is aimed at the middle of the stop, around it rays fill a disc "
    "of the entrance pupil's diameter",
    "stop": "stop: every ray is aimed at its point of the stop, whose radius is that of the real "
    "marginal ray",
}
_CAPTIONS: Final = {
    "layout": "Rays of the reference wavelength; of many fields, five.",
    "mtf": "Tangential: lines across the meridian; sagittal: along it. Of many fields, five.",
    "spots": "About the chief ray of the reference wavelength, all fields to one scale; circle: "
    "Airy disc. RMS about the centroid at the wavelength of the file next to the reference.",
    "field": "T tangential (solid), S sagittal (dashed) focus of close rays. Distortion against "
    "the paraxial chief ray on the sensor. Light is traced with every ray aimed at the stop.",
    "seidel": "S = 2|n'u'| times the transverse third-order aberration: negative S_I is "
    "undercorrected, negative S_V barrel distortion; Welford's sums are the negatives.",
}


def to_html(facts: LensFacts, pictures: Mapping[str, str]) -> str:
    """Return the page.

    Args:
        facts: Of the lens.
        pictures: Name -> SVG text.
    """
    lens = facts.lens
    parts = [f"<h1>{escape(lens.name)}</h1>"]
    if lens.note:
        parts.append(f"<p class=small>{escape(lens.note)}</p>")
    parts.append(f"<p>{escape(_pupil_words(facts))}</p>")
    parts += [f"<p class=note>{escape(note)}</p>" for note in facts.notes]
    for name in ("layout",):
        parts += _picture(name, pictures)
    parts += ["<h2>First order</h2>", _first_order(facts)]
    parts += ["<h2>Prescription</h2>", _prescription(facts)]
    parts += _picture("spots", pictures)
    parts += [_fields(facts), _convergence(facts), f"<p>PSF: {escape(facts.model.reason)}.</p>"]
    for name in ("mtf", "field", "colour", "seidel"):
        parts += _picture(name, pictures)
    parts.append(_seidel(facts))
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>camkit lens: {escape(lens.name)}</title><style>{STYLE}</style></head>\n<body>"
        + "\n".join(parts)
        + "</body></html>\n"
    )


def _pupil_words(facts: LensFacts) -> str:
    real = facts.real_stop_mm
    radii = f"Stop radius {facts.paraxial.stop_semi_diameter_mm:.6g} mm by the paraxial marginal "
    radii += "ray" if real is None else f"ray, {real:.6g} mm by the real one"
    return (
        f"Pupil {_PUPILS[facts.pupil.definition]}. Sampling {facts.pupil.sampling} "
        f"({len(facts.pupil.samples.x)} rays per field and wavelength). {radii}."
    )


def _picture(name: str, pictures: Mapping[str, str]) -> list[str]:
    if name not in pictures:
        return []
    # ids of several pictures in one page must differ
    svg = pictures[name][pictures[name].index("<svg") :]
    svg = re.sub(r'(id="|href="#|url\(#)', rf"\g<1>{name}-", svg)
    caption = _CAPTIONS.get(name)
    lines = [f"<h2>{TITLES[name]}</h2>", svg]
    return [*lines, f"<p class=small>{escape(caption)}</p>"] if caption else lines


def _first_order(facts: LensFacts) -> str:
    data, lens = facts.paraxial, facts.lens
    sensor = facts.lens.surfaces[-1].thickness_mm
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
    return _table(("", ""), [(name, _number(value, 8)) for name, value in rows])


def _prescription(facts: LensFacts) -> str:
    head = (
        "surface",
        "radius, mm",
        "thickness, mm",
        "glass",
        "semi-diameter, mm",
        "conic",
        "r², r⁴, …",
    )
    rows = []
    for number, surface in enumerate(facts.lens.surfaces):
        stop = " (stop)" if number == facts.lens.stop else ""
        rows.append(
            (
                f"{number}{stop}",
                _number(surface.radius_mm, 8),
                _number(surface.thickness_mm, 8),
                surface.glass,
                _number(surface.semi_diameter_mm, 6),
                _number(surface.conic, 6) if surface.conic else "",
                ", ".join(_number(a, 6) for a in surface.even_asphere),
            )
        )
    return _table(head, rows) + _grooves(facts)


def _grooves(facts: LensFacts) -> str:
    found = grooves_of(facts.lens)
    if not found:
        return ""
    head = ("surface", "groove, µm", "walls", "narrowest, mm", "tool radius, µm", "grooves")
    rows = [
        (
            str(g["surface"]),
            _number(g["groove_depth_um"], 6),
            str(g["walls"]),
            _number(math.nan if g["narrowest_mm"] is None else g["narrowest_mm"], 4),
            _number(g["tool_radius_um"], 4),
            "ideal" if g["ideal"] else "with walls",
        )
        for g in found
    ]
    return _table(head, rows)


def _fields(facts: LensFacts) -> str:
    head = (
        *("field", "µm", "RMS, µm", "RMS chief, µm", "max, µm", "Airy, µm", "OPD RMS, waves"),
        *("distortion, %", "light", "rays lost"),
    )
    rows = []
    for i, angle_rad in enumerate(facts.lens.field_angles_rad):
        for j, wave in enumerate(facts.lens.wavelengths_um):
            lost = {name: n for name, n in facts.fates(i, j).items() if n and name != "valid"}
            spots = (facts.rms_mm, facts.rms_chief_mm, facts.max_mm)
            rows.append(
                (
                    f"{to_degrees(angle_rad):.4g}°",
                    f"{wave:.4g}",
                    *(_number(float(v[i, j]) * UM_PER_MM, 5) for v in spots),
                    _number(float(facts.airy_mm[j]) * UM_PER_MM, 4),
                    _number(float(facts.wavefront_um[i, j]) / wave, 4),
                    _number(100 * float(facts.distortion[i, j]), 4),
                    _number(float(facts.illumination[i, j]), 4),
                    ", ".join(f"{n} {name.replace('_', ' ')}" for name, n in lost.items()) or "0",
                )
            )
    return _table(head, rows)


def _convergence(facts: LensFacts) -> str:
    found = facts.convergence
    angles = [f"{to_degrees(a):.4g}°" for a in facts.lens.field_angles_rad]
    rows = [
        (name, str(rays), *(_number(v * UM_PER_MM, 5) for v in rms))
        for name, rays, rms in zip(found.samplings, found.rays, found.rms_mm.tolist(), strict=True)
    ]
    intro = "RMS radius in µm about the centroid, reference wavelength, by sampling of the pupil:"
    return f"<p class=small>{intro}</p>" + _table(("sampling", "rays", *angles), rows)


def _seidel(facts: LensFacts) -> str:
    sums = facts.seidel
    if sums is None:
        return ""
    head = ("surface", *SEIDEL_NAMES, "C_L", "C_T")
    rows = [
        (str(i), *(_number(v, 5) for v in (*five, axial, lateral)))
        for i, (five, axial, lateral) in enumerate(
            zip(
                sums.surfaces_mm.tolist(),
                sums.axial_colour_mm.tolist(),
                sums.lateral_colour_mm.tolist(),
                strict=True,
            )
        )
    ]
    colours = (sums.axial_colour_mm, sums.lateral_colour_mm)
    total = [*sums.sums_mm.tolist(), *(float(c.sum()) for c in colours)]
    rows.append(("sum", *(_number(v, 6) for v in total)))
    transverse = sums.transverse_mm()
    short = [(name, _number(value, 5)) for name, value in transverse.items()]
    return (
        _table(head, rows)
        + "<p class=small>Transverse, in mm (PTZ in 1/mm), as CODE V lists them:</p>"
        + _table(tuple(name for name, _ in short), [tuple(value for _, value in short)])
    )


def _number(value: float, digits: int) -> str:
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "-∞"
    return f"{value:.{digits}g}"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    top = "<tr>" + "".join(f"<th>{escape(h)}</th>" for h in head) + "</tr>" if any(head) else ""
    cells = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f"<div class=scroll><table>{top}{cells}</table></div>"
