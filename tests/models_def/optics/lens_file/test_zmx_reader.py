import math
from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.errors import CamkitError, ContractError, DecodeError, UnsupportedError
from camkit.models_def.optics.glass.agf import parse_agf
from camkit.models_def.optics.glass.catalogue import preferred_catalogues
from camkit.models_def.optics.glass.encoding import read_text
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.lens_file.zmx_field import FieldType, with_field_points
from camkit.models_def.optics.lens_file.zmx_glass import GlassRule
from camkit.models_def.optics.lens_file.zmx_reader import parse_zmx, read_zmx
from camkit.models_def.optics.paraxial import focal_lengths, paraxial_data, paraxial_image
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.shape.phase import Phase
from camkit.models_def.optics.spot import chief_heights
from camkit.models_def.optics.trace import Rays, surface_tensors, trace
from tests.data_folder import data_path
from tests.zmx_factory import BACK, FRONT, HEAD, LA1131, OBJECT

MINE = parse_agf("NM FOO 2 0 1.6 50\nCD 1.4 0.01\nLD 0.3 2\n", "mine")


def _changed(*changes: tuple[str, str]) -> str:
    text = LA1131
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return text


def test_vendor_file_is_read_whole() -> None:
    found = parse_zmx(LA1131)
    lens = found.lens
    assert found.notes == ()
    assert lens.name == "LA1131 Plano-Convex - N-BK7 Ø25.4"
    assert lens.note == "FOR INFORMATION ONLY"
    assert (lens.aperture_kind, lens.aperture_value) == ("entrance_pupil_diameter_mm", 22.86)
    assert (lens.stop, lens.object_distance_mm) == (0, math.inf)
    assert lens.wavelengths_um == (0.4861, 0.5876, 0.6563)
    assert lens.reference_wavelength_um == 0.5876
    assert lens.field_angles_rad == (0.0,)
    front, back = lens.surfaces
    assert front.radius_mm == pytest.approx(25.75, rel=1e-15)
    assert (front.glass, front.thickness_mm) == ("N-BK7-Schott", 5.34)
    assert (back.glass, back.thickness_mm) == ("air", 44.20486329487)


def test_rays_through_the_vendor_file_land_where_its_program_says() -> None:
    lens = parse_zmx(LA1131).lens
    tensors = surface_tensors(lens, torch.tensor(0.4861, dtype=torch.float64))
    edge = torch.tensor(11.43, dtype=torch.float64)
    zero, one = torch.zeros_like(edge), torch.ones_like(edge)
    rays = Rays(x=zero, y=edge, z=zero, l=zero, m=zero, n=one, fate=zero.to(torch.int8))
    # the file's automatic semi-diameter of the image, to its thirteen digits
    assert abs(float(trace(tensors, rays).y)) == pytest.approx(0.3584516158236, abs=2e-12)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-8", "latin-1"])
def test_every_usual_encoding_gives_the_same_lens(tmp_path, encoding: str) -> None:
    path = tmp_path / "lens.ZMX"
    path.write_bytes(LA1131.replace("\n", "\r\n").encode(encoding))
    assert read_zmx(path).lens == parse_zmx(LA1131).lens


def test_missing_gcat_type_unit_mode_and_name_are_tolerated() -> None:
    lines = [
        line
        for line in LA1131.splitlines()
        if line.split()[0] not in {"GCAT", "TYPE", "UNIT", "MODE", "NAME", "NOTE"}
    ]
    lens = parse_zmx("\n".join(lines), name="file").lens
    assert lens.surfaces == parse_zmx(LA1131).lens.surfaces
    assert lens.name == "file"


def test_indentation_is_not_needed() -> None:
    text = "\n".join(line.strip() for line in LA1131.splitlines())
    assert parse_zmx(text).lens == parse_zmx(LA1131).lens


def test_automatic_semi_diameter_limits_nothing_and_a_fixed_one_vignettes() -> None:
    front, back = parse_zmx(LA1131).lens.surfaces
    assert front.semi_diameter_mm == 12.7
    assert back.semi_diameter_mm == math.inf


def test_circular_aperture_takes_the_place_of_the_semi_diameter() -> None:
    text = _changed(("  FLAP 0 1.27E+1 0", "  CLAP 0 9.5 0"), ("  FLAP 0 1.08", "  CLAP 0 1.08"))
    front, back = parse_zmx(text).lens.surfaces
    assert (front.semi_diameter_mm, back.semi_diameter_mm) == (9.5, 10.83488179091)


def test_r2_term_of_an_even_asphere_is_honoured() -> None:
    """The asphere of optics-notes 3.5: f = 1 / ((n - 1) (c + 2 a2)) = 25.7153."""
    text = HEAD.replace("WAVM 2 5.876E-1 1", "WAVM 2 0.587 1") + OBJECT + FRONT + BACK
    text = text.replace("  TYPE STANDARD\n  CURV 3.88", "  TYPE EVENASPH\n  CURV 0.05\n  KEEP 3.88")
    terms = "".join(
        f"  PARM {i} {a}\n"
        for i, a in enumerate((-2.248851e-4, -4.690412e-6, -6.404376e-8, 0, 0, 0, 0, 0), start=1)
    )
    text = text.replace("GLAS N-BK7", "GLAS N-SF11").replace("  DISZ 5.34\n", f"  DISZ 7\n{terms}")
    lens = parse_zmx(text).lens
    assert lens.surfaces[0].even_asphere == (-2.248851e-4, -4.690412e-6, -6.404376e-8)
    assert paraxial_data(lens).efl_mm == pytest.approx(25.7153, abs=5e-5)


def test_conic_is_read() -> None:
    text = _changed(("  DISZ 5.34", "  CONI -1.01\n  DISZ 5.34"))
    assert parse_zmx(text).lens.surfaces[0].conic == -1.01


def _shaped(kind: str, *lines: str, unit: str = "MM") -> Surface:
    """Return the front of the singlet with another type."""
    text = _changed(("TYPE STANDARD\n  CURV 3.8", f"TYPE {kind}\n  CURV 3.8"))
    block = "".join(f"  {line}\n" for line in lines)
    text = text.replace("  DISZ 5.34", block + "  DISZ 5.34").replace("UNIT MM", f"UNIT {unit}")
    return parse_zmx(text).lens.surfaces[0]


def test_odd_asphere_is_read() -> None:
    lines = ("PARM 1 0.01", "PARM 2 0.2", "PARM 3 0.3", "PARM 8 0.8")
    assert _shaped("ODDASPHE", *lines).odd_asphere == (0.01, 0.3)
    assert _shaped("ODDASPHE", *lines).even_asphere == (0.2, 0.0, 0.0, 0.8)
    centimetres = _shaped("ODDASPHE", *lines, unit="CM")
    assert centimetres.odd_asphere == pytest.approx((0.01, 0.3 / 100))
    assert centimetres.even_asphere == pytest.approx((0.02, 0.0, 0.0, 0.8 / 1e7))


@pytest.mark.parametrize("unit", ["MM", "CM"])
def test_extended_aspheres_are_read(unit: str) -> None:
    """The height at r = 0.1 of the unit is the sum of coefficients times powers, in that unit."""
    mm = 10.0 if unit == "CM" else 1.0
    rho = torch.tensor([(0.1 * mm) ** 2], dtype=torch.float64)
    for kind, radius, powers in (
        ("XASPHERE", 1.0, (2, 4, 6)),
        ("XASPHERE", 0.2, (2, 4, 6)),
        ("XOSPHERE", 1.0, (1, 2, 3)),
        ("XOSPHERE", 0.2, (1, 2, 3)),
    ):
        lines = (
            "XDAT 1 3 0 0",
            f"XDAT 2 {radius} 0 0",
            "XDAT 3 1e-3",
            "XDAT 4 2e-3",
            "XDAT 5 3e-3",
        )
        surface = _shaped(kind, *lines, "XDAT 6 9", unit=unit)
        plain = replace(surface, even_asphere=(), odd_asphere=(), normal_radius_mm=None)
        height, base = (s.profile.height_mm(rho.sqrt()) for s in (surface, plain))
        wanted = sum(
            a * (0.1 / radius) ** p for a, p in zip((1e-3, 2e-3, 3e-3), powers, strict=True)
        )
        assert float(height - base) == pytest.approx(wanted * mm, rel=1e-9)
        assert surface.normal_radius_mm == (None if radius == 1 else pytest.approx(radius * mm))


def test_radial_phase_is_read() -> None:
    lines = ("PARM 0 2", "PARM 2 1e-3", "XDAT 1 2", "XDAT 2 5.0", "XDAT 3 -80.0", "XDAT 4 6.0")
    phase = _shaped("BINARY_2", *lines).phase
    assert phase is not None
    assert phase == Phase(radius_mm=5.0, radial_rad=(-80.0, 6.0), order=2.0)
    assert _shaped("BINARY_2", *lines).even_asphere == (0.0, 1e-3)
    centimetres = _shaped("BINARY_2", *lines, unit="CM").phase
    assert centimetres == replace(phase, radius_mm=50.0)


@pytest.mark.parametrize(
    ("kind", "lines", "message"),
    [
        ("XASPHERE", ("XDAT 1 3",), r"needs XDAT 1 .* and XDAT 2"),
        ("XASPHERE", ("XDAT 1 3", "XDAT 2 0"), r"needs XDAT 1 .* and XDAT 2"),
        ("XOSPHERE", ("XDAT 1 3", "XDAT 2 1", "XDAT 999 1"), "XDAT is 1..242"),
        ("BINARY_2", ("PARM 9 1",), "PARM of BINARY_2 is 0..8"),
    ],
)
def test_damaged_shapes_are_refused(kind: str, lines: tuple[str, ...], message: str) -> None:
    with pytest.raises(DecodeError, match=message):
        _shaped(kind, *lines)


@pytest.mark.parametrize(("unit", "mm"), [("CM", 10.0), ("IN", 25.4), ("METER", 1000.0)])
def test_lengths_are_converted_to_millimetres(unit: str, mm: float) -> None:
    changes = [
        ("UNIT MM", f"UNIT {unit}"),
        ("TYPE STANDARD\n  CURV 3.8", "TYPE EVENASPH\n  CURV 3.8"),
    ]
    text = _changed(*changes, ("  DISZ 5.34", "  PARM 2 0.5\n  DISZ 5.34"))
    lens, plain = parse_zmx(text).lens, parse_zmx(LA1131).lens
    front = lens.surfaces[0]
    assert front.radius_mm == pytest.approx(25.75 * mm)
    assert front.thickness_mm == pytest.approx(5.34 * mm)
    assert front.semi_diameter_mm == pytest.approx(12.7 * mm)
    assert front.even_asphere == pytest.approx((0, 0.5 / mm**3))
    assert lens.aperture_value == pytest.approx(22.86 * mm)
    assert lens.wavelengths_um == plain.wavelengths_um


@pytest.mark.parametrize(
    ("line", "kind", "value"),
    [
        ("FNUM 4.5 0", "f_number", 4.5),
        ("FNUM 4.5 1", "f_number", 4.5),
        ("FLOA", "stop_semi_diameter_mm", 12.7),
        ("FLOA 0", "stop_semi_diameter_mm", 12.7),
    ],
)
def test_aperture_kinds_are_kept(line: str, kind: str, value: float) -> None:
    lens = parse_zmx(_changed(("ENPD 2.286E+1", line))).lens
    assert (lens.aperture_kind, lens.aperture_value) == (kind, value)


def test_a_stop_without_size_is_as_wide_as_the_other_rims_let_the_axis_see() -> None:
    """A plane in front of the lens is the stop: the beam is parallel there."""
    stop = "SURF 1\n  STOP\n  TYPE STANDARD\n  CURV 0\n  DISZ 5\n"
    text = _changed(("ENPD 2.286E+1", "FLOA"), ("  STOP\n", ""))
    start = text.index("SURF 1")
    rest = text[start:].replace("SURF 3", "SURF 4").replace("SURF 2", "SURF 3")
    lens = parse_zmx(text[:start] + stop + rest.replace("SURF 1", "SURF 2"))
    assert lens.lens.aperture_value == 12.7
    assert lens.notes == (
        "line 7: FLOA, and the stop has no DIAM: 12.7 mm, the widest that the other rims let the "
        "axis see",
    )


def test_object_space_aperture_becomes_an_entrance_pupil() -> None:
    text = _changed(("ENPD 2.286E+1", "OBNA 0.1 0"), ("DISZ INFINITY", "DISZ 200"))
    lens = parse_zmx(text).lens
    assert lens.object_distance_mm == 200
    half = lens.aperture_value / 2
    # the stop is the first surface: the pupil lies there
    assert half / math.hypot(half, 200) == pytest.approx(0.1, rel=1e-12)


def test_fields_are_taken_as_distances_from_the_axis_each_once() -> None:
    text = _changed(("FTYP 0 0 1", "FTYP 0 0 4"), ("YFLN 0 0 0 0", "YFLN 0 -14 14 7"))
    text = text.replace("XFLN 0 0 0 0", "XFLN 0 0 0 7")
    angles = [math.degrees(a) for a in parse_zmx(text).lens.field_angles_rad]
    skew = math.degrees(math.atan(math.sqrt(2) * math.tan(math.radians(7))))
    assert angles == pytest.approx([0, skew, 14])


def test_angle_of_a_near_object_is_seen_from_the_entrance_pupil() -> None:
    text = _changed(
        ("FTYP 0 0 1", "FTYP 0 0 1"), ("YFLN 0", "YFLN 10"), ("DISZ INFINITY", "DISZ 90")
    )
    dummy = "SURF 1\n  CURV 0 0\n  DISZ 10\n  DIAM 0 0\n"
    front = FRONT.replace("SURF 1", "SURF 2")
    back = BACK.replace("SURF 3", "SURF 4").replace("SURF 2", "SURF 3")
    text = text.replace(FRONT, dummy + front).replace(BACK, back)
    lens = parse_zmx(text).lens
    assert lens.stop == 1
    # object height tan(10) * (90 + 10), seen from the first vertex at 90
    expected = math.tan(math.radians(10)) * 100 / 90
    assert math.tan(lens.field_angles_rad[0]) == pytest.approx(expected, rel=1e-12)


def test_object_heights_become_angles_at_the_first_vertex() -> None:
    changes = [
        ("FTYP 0 0 1", "FTYP 1 0 2"),
        ("YFLN 0 0", "YFLN 0 20"),
        ("DISZ INFINITY", "DISZ 100"),
    ]
    angles = parse_zmx(_changed(*changes)).lens.field_angles_rad
    assert angles == (0.0, math.atan(0.2))


def test_paraxial_image_height_is_efl_times_tangent() -> None:
    lens = parse_zmx(_changed(("FTYP 0 0 1", "FTYP 2 0 2"), ("YFLN 0 0", "YFLN 0 5"))).lens
    tensors = surface_tensors(lens, torch.tensor(0.5876, dtype=torch.float64))
    efl = float(focal_lengths(tensors)[0])
    assert math.tan(lens.field_angles_rad[1]) == pytest.approx(5 / efl, rel=1e-12)


def test_paraxial_image_height_of_a_near_object_follows_the_magnification() -> None:
    changes = [
        ("FTYP 0 0 1", "FTYP 2 0 2"),
        ("YFLN 0 0", "YFLN 0 5"),
        ("DISZ INFINITY", "DISZ 100"),
    ]
    lens = parse_zmx(_changed(*changes)).lens
    data = paraxial_data(lens)
    # Newton: |m| = f / (distance from the front focal point)
    magnification = data.efl_mm / (100 + data.ffl_mm)
    assert math.tan(lens.field_angles_rad[1]) == pytest.approx(5 / magnification / 100, rel=1e-9)


def test_real_image_height_is_met_by_the_chief_ray() -> None:
    lens = parse_zmx(_changed(("FTYP 0 0 1", "FTYP 3 0 2"), ("YFLN 0 0", "YFLN 0 5"))).lens
    slopes = torch.tan(torch.tensor(lens.field_angles_rad, dtype=torch.float64))
    assert chief_heights(lens, slopes).tolist() == pytest.approx([0, 5], abs=1e-9)


def test_weights_of_wavelengths_that_differ_are_noted_and_one_of_0_does_not_count() -> None:
    text = LA1131.replace("4.861E-1 1", "4.861E-1 0.25").replace("6.563E-1 1", "6.563E-1 0")
    found = parse_zmx(text)
    assert found.lens.wavelengths_um == (0.4861, 0.5876)
    assert [note for note in found.notes if "weights" in note] == [
        "wavelength weights 0.25, 1 left out: all wavelengths count alike"
    ]
    assert not any("weights" in note for note in parse_zmx(LA1131).notes)


def test_image_heights_beyond_the_reach_of_the_lens_are_left_out_with_a_note() -> None:
    heights = [(0.0, 0.0), (0.0, 5.0), (0.0, 300.0)]
    lens, notes = with_field_points(
        find_lens("cooke-triplet"), FieldType.REAL_IMAGE_HEIGHT, heights
    )
    assert len(lens.field_angles_rad) == 2
    assert "fields at 300 mm are left out: the lens is aimed to" in notes[0]


def test_wavelengths_without_a_count_lose_the_filling_of_the_table() -> None:
    text = _changed(("FTYP 0 0 1 3 0 0 0", "FTYP 0 0"))
    assert parse_zmx(text).lens.wavelengths_um == (0.4861, 0.5876, 0.6563)
    old = text.replace("WAVM", "XAVM").replace("PWAV 2", "WAVL 0.486 0.588 0.656\nPWAV 3")
    assert parse_zmx(old).lens.wavelengths_um == (0.486, 0.588, 0.656)
    assert parse_zmx(old).lens.reference_wavelength_um == 0.656


@pytest.mark.parametrize(
    ("glas", "gcat", "name"),
    [
        ("F2 0 0 1.5 40", "SCHOTT", "F2-Schott"),
        ("F2 0 0 1.5 40", "HIKARI SCHOTT", "F2-Hikari"),
        ("SK16 0 0 1.5 40", "SCHOTT", "SK16-Schott1983"),
        ("SK18 0 0 1.5 40", "SCHOTT", "SK18-Hikari"),
        ("BK7 0 0 1.5 40", "SCHOTT", "BK7-Schott1983"),
        ("BAF4 0 0", "SCHOTT HIKARI", "BAF4-Schott1983"),
        ("BAF4 0 0", "HIKARI SCHOTT", "BAF4-Hikari"),
        ("N-SF6HTULTRA 0 0", "", "N-SF6HTultra-Schott"),
        ("PMMA 0 0 1.5 40", "MISC", "PMMA-Misc"),
        ("PMMA 0 0 1.5 40", "", "PMMA-Misc"),
        ("SILICA 0 0", "UNKNOWN CORNING", "SILICA-Misc"),
        ("FOO 0 0 1.5 40", "SCHOTT", "FOO-mine"),
        ("___BLANK 1 0 1.5168 64.17 0 0 0 0 0 0", "", "model:1.5168,64.17"),
        ("___BLANK 1 0 1.5168 64.17 0.01 0 0 0 0 0", "", "model:1.5168,64.17,0.01"),
        ("AIR", "", "air"),
    ],
)
def test_glass_is_found_in_the_order_of_gcat(glas: str, gcat: str, name: str) -> None:
    text = _changed(("GLAS N-BK7 0 0 0 0 0 0 0 0 0 0", f"GLAS {glas}"))
    text = text.replace("GCAT SCHOTT INFRARED MISC", f"GCAT {gcat}")
    front = parse_zmx(text, [MINE]).lens.surfaces[0]
    assert front.glass == name
    assert (front.material is not None) == name.endswith("mine")


@pytest.mark.parametrize(
    ("glas", "message"),
    [
        (
            "XN-BK7",
            r"line 32: surface 1: glass must .*'XN-BK7'.*N-BK7-Schott.*a file in .agf, with glass",
        ),
        ("F2", "may be F2-Schott or F2-Hikari"),
        ("XN-BK7 0 0 1.5 4.0E+1", "a file in .agf, with glass$"),
        ("___BLANK 1 0 0.5 60", "a model glass needs"),
    ],
)
def test_unknown_glass_is_refused_with_its_line(glas: str, message: str) -> None:
    text = _changed(("GLAS N-BK7 0 0 0 0 0 0 0 0 0 0", f"GLAS {glas}"), ("GCAT SCHOTT", "GCAT"))
    with pytest.raises(ContractError, match=message):
        parse_zmx(text)


@pytest.mark.parametrize(
    ("glas", "rule", "name", "note"),
    [
        # a patent's glass is near to one with a name: 7.7e-3 apart
        (
            "K5G20 0 0 1.5311 55.9",
            "nearest",
            "model:1.5311,55.9",
            "K5G20 states n_d 1.5311 and V_d 55.9, K5G20-Schott has 1.52344 and 56.76: "
            "read by its numbers (glass decides)",
        ),
        (
            "K5G20 0 0 1.5311 55.9",
            "names",
            "K5G20-Schott",
            "K5G20 states n_d 1.5311 and V_d 55.9, K5G20-Schott has 1.52344 and 56.76: "
            "read by its name (glass decides)",
        ),
        # 2e-4 apart: another melt
        (
            "N-LASF41 0 0 1.83481 42.7",
            "nearest",
            "N-LASF41-Schott",
            "N-LASF41 states n_d 1.83481 and V_d 42.7, N-LASF41-Schott has 1.83501 and 43.13: "
            "read by its name (glass decides)",
        ),
        # the same n_d, but 2e-3 more dispersion
        (
            "N-BK7 0 0 1.5168 55",
            "nearest",
            "model:1.5168,55.0",
            "N-BK7 states n_d 1.5168 and V_d 55, N-BK7-Schott has 1.5168 and 64.17: "
            "read by its numbers (glass decides)",
        ),
        ("N-BK7 0 0 1.5168 64.17", "nearest", "N-BK7-Schott", None),
        ("N-BK7 0 0 1.5168 64.17", "numbers", "model:1.5168,64.17", None),
        # programs that know no numbers write these
        ("N-BK7 0 0 1.5 4.0E+1 0 0 0 0 0 0", "numbers", "N-BK7-Schott", None),
        ("N-BK7 0 0 0 0 0 0 0 0 0 0", "numbers", "N-BK7-Schott", None),
        (
            "XN-BK7 0 0 1.6 50.3 0.01",
            "nearest",
            "model:1.6,50.3,0.01",
            "XN-BK7 is no glass of one catalogue: read by its numbers, n_d 1.6 and V_d 50.3; "
            "near to them: KZFSN9-SchottObsolete (1.59856, 46.90)",
        ),
        (
            "F2 0 0 1.62 36.37",
            "nearest",
            "model:1.62,36.37",
            "F2 is no glass of one catalogue: read by its numbers, n_d 1.62 and V_d 36.37; "
            "near to them: F2-Schott (1.62004, 36.37)",
        ),
    ],
)
def test_numbers_beside_a_name_decide_where_they_differ(
    glas: str, rule: GlassRule, name: str, note: str | None
) -> None:
    text = _changed(("GLAS N-BK7 0 0 0 0 0 0 0 0 0 0", f"GLAS {glas}"), ("GCAT SCHOTT", "GCAT"))
    text = text.replace("GCAT INFRARED", "GCAT SCHOTT") if name != "model:1.62,36.37" else text
    zmx = parse_zmx(text, rule=rule)
    assert zmx.lens.surfaces[0].glass == name
    assert len(zmx.notes) == (note is not None)
    assert note is None or zmx.notes[0].startswith(f"line 32: {note}")


def test_a_name_without_numbers_is_refused_where_names_hold() -> None:
    text = _changed(("GLAS N-BK7 0 0 0 0 0 0 0 0 0 0", "GLAS XN-BK7 0 0 1.6 50.3"))
    with pytest.raises(ContractError, match="'XN-BK7'"):
        parse_zmx(text, rule="names")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("  TYPE STANDARD\n  CURV 3.8", "  TYPE COORDBRK\n  CURV 3.8"), "surface 1 .* COORDBRK"),
        (("  TYPE STANDARD\n  CURV 3.8", "  TYPE TOROIDAL\n  CURV 3.8"), "surface 1 .* TOROIDAL"),
        (("GLAS N-BK7", "GLAS MIRROR"), "surface 1 is a mirror"),
        (("  FLAP 0 1.27E+1 0", "  SQAP 5 5 0"), "surface 1 has an aperture SQAP"),
        (("  FLAP 0 1.27E+1 0", "  CLAP 1 12 0"), "central obscuration"),
        (("  FLAP 0 1.27E+1 0", "  OBDC 0 1.5"), "decentred"),
        (("  FLAP 0 1.27E+1 0", "  SCBD 1 0 0 0 0 90 0 0"), "tilted"),
        (("MODE SEQ", "MODE NSC"), "MODE SEQ"),
        (("  DISZ 5.34", "  DISZ INFINITY"), "surface 1 is infinitely thick"),
        (("DISZ INFINITY", "DISZ -20"), "positive distance"),
        (("CURV 0.0 0", "CURV 0.1 0"), "object is curved"),
        (("SURF 3\n  TYPE STANDARD\n  CURV 0.0", "SURF 3\n  CURV 0.01"), "the image, and curved"),
        (("FTYP 0 0 1", "FTYP 4 0 1"), "fields are of kind 4"),
        (("FTYP 0 0 1", "FTYP 0 1 1"), "object space is telecentric"),
        (("FTYP 0 0 1", "FTYP 1 0 1"), "finite distance"),
        (("ENPD 2.286E+1", "OBNA 5 0"), "NA < 1"),
        (("ENPD 2.286E+1", "OBNA 5 1"), "OBNA given as an angle"),
    ],
)
def test_what_camkit_does_not_trace_is_refused_by_name(
    change: tuple[str, str], message: str
) -> None:
    with pytest.raises((UnsupportedError, DecodeError), match=message):
        parse_zmx(_changed(change))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("DISZ 5.34", "DISZ nan"), "line 31: DISZ needs a finite number"),
        (("  DISZ 5.34", "  HIDE 5.34"), "surface 1 has no DISZ; is the file cut off"),
        (("DISZ 5.34", "DISZ"), "line 31: DISZ needs 1 values"),
        (("CURV 3.88", "CURV 1e300 3.88"), "line 29: CURV needs a finite"),
        (("ENPD 2.286E+1", "ENPD 3\nFNUM 4 0"), "got ENPD, FNUM"),
        (("ENPD 2.286E+1", "ENPD 0"), "ENPD must be > 0"),
        (("SURF 2\n", "SURF 2\n  STOP\n"), r"must hold STOP; got \[1, 2\]"),
        (("SURF 2", "SURF 7"), "expected SURF 2; got SURF 7"),
        (("UNIT MM", "UNIT FURLONG"), "UNIT must be one of"),
        (("PWAV 2", "PWAV 9"), "PWAV must be one of 3"),
        (("DIAM 1.27E+1 1", "DIAM -5 1"), "DIAM must be > 0"),
    ],
)
def test_damaged_file_is_refused_with_its_line(change: tuple[str, str], message: str) -> None:
    with pytest.raises(DecodeError, match=message):
        parse_zmx(_changed(change))


def test_left_out_vignetting_factors_and_configurations_are_noted() -> None:
    text = _changed(("VCYN 0 0", "VCYN 0 0.2"), ("MNUM 1 1", "MNUM 3 1"))
    vignetting, zoom = parse_zmx(text).notes
    assert "VCYN" in vignetting
    assert "3 configurations" in zoom


@settings(max_examples=150, deadline=None)
@given(cut=st.integers(0, len(LA1131)), noise=st.text(max_size=15), start=st.integers(0, 300))
def test_cut_or_spoilt_file_gives_a_lens_or_an_expected_error(
    cut: int, noise: str, start: int
) -> None:
    try:
        parse_zmx(LA1131[:start] + noise + LA1131[start:cut] + noise)
    except CamkitError:
        return


@settings(max_examples=100, deadline=None)
@given(data=st.data())
def test_replaced_words_give_a_lens_or_an_expected_error(data: st.DataObject) -> None:
    lines = LA1131.splitlines()
    number = data.draw(st.integers(0, len(lines) - 1))
    words = lines[number].split()
    position = data.draw(st.integers(0, len(words) - 1))
    words[position] = data.draw(
        st.sampled_from(["nan", "inf", "-1", "1e12", "0", "x", "INFINITY", "1e-300", ""])
    )
    lines[number] = "  " * lines[number].startswith(" ") + " ".join(words)
    try:
        parse_zmx("\n".join(lines))
    except CamkitError:
        return


@pytest.mark.parametrize(("flag", "limits"), [(0, False), (1, True), (2, True), (3, False)])
def test_a_semi_diameter_that_is_stated_or_picked_up_vignettes(flag: int, limits: bool) -> None:
    text = _changed(("DIAM 1.083488179091E+1 0", f"DIAM 1.083488179091E+1 {flag}"))
    back = parse_zmx(text).lens.surfaces[1]
    assert back.semi_diameter_mm == (10.83488179091 if limits else math.inf)


@pytest.mark.parametrize(
    ("change", "note"),
    [
        (("GLAS N-BK7", "GLAS BK7"), "line 32: BK7 is read as BK7-Schott1983"),
        (("GLAS N-BK7", "GLAS S-LAH64"), "line 32: S-LAH64 is read as S-LAH64-Ohara"),
        (("UNIT MM", "ENVD 60 0.5 1\nUNIT MM"), "line 6: 60 degrees C and 0.5 atm left out"),
    ],
)
def test_what_is_read_otherwise_than_the_file_says_is_noted(
    change: tuple[str, str], note: str
) -> None:
    (found,) = parse_zmx(_changed(change)).notes
    assert found.startswith(note)


def test_a_file_cut_off_behind_a_glass_is_refused() -> None:
    front = FRONT.replace("SURF 1", "SURF 2").replace("  STOP\n", "")
    text = HEAD + OBJECT + "SURF 1\n  STOP\n  DISZ 1\n" + front
    with pytest.raises(DecodeError, match="begin before it; is the file cut off"):
        parse_zmx(text.replace("CURV 3.883495145631069700E-002", "CURV 0"))
    with pytest.raises(UnsupportedError, match="or the file is cut off"):
        parse_zmx(text)


def test_an_asphere_in_metres_is_that_in_millimetres() -> None:
    """The coefficient of r^16 has the unit length^-15: 1e45 times as large in metres."""
    terms = [0.0, -4.7e-6, 3e-9, 0.0, 0.0, 0.0, 0.0, 1e-20]

    def lens_in(unit: str, mm: float) -> Lens:
        lines = "".join(f"  PARM {i} {a * mm ** (2 * i - 1)!r}\n" for i, a in enumerate(terms, 1))
        text = f"UNIT {unit}\nENPD {10 / mm}\nWAVM 1 0.55 1\nSURF 0\n  DISZ INFINITY\n"
        text += f"SURF 1\n  STOP\n  TYPE EVENASPH\n  CURV {0.02 * mm}\n{lines}"
        text += f"  DISZ {6 / mm}\n  GLAS N-BK7\n  DIAM {7 / mm} 1\n"
        text += f"SURF 2\n  DISZ {100 / mm}\nSURF 3\n  DISZ 0\n"
        return parse_zmx(text).lens

    plain = lens_in("MM", 1.0)
    assert plain.surfaces[0].even_asphere == tuple(terms)
    for unit, mm in (("METER", 1000.0), ("IN", 25.4), ("CM", 10.0)):
        lens = lens_in(unit, mm)
        assert lens.aperture_value == pytest.approx(10)
        for ours, theirs in zip(lens.surfaces, plain.surfaces, strict=True):
            assert ours.even_asphere == pytest.approx(theirs.even_asphere, rel=1e-12)
            assert ours.thickness_mm == pytest.approx(theirs.thickness_mm, rel=1e-12)
            assert ours.semi_diameter_mm == pytest.approx(theirs.semi_diameter_mm, rel=1e-12)


def test_an_object_in_water_is_imaged_as_the_closed_form_has_it() -> None:
    """n'/s' = n/s + (n' - n) / R at one surface, and the image height of an angle."""
    water, glass = 1.333, 1.5
    text = "FLOA\nWAVM 1 0.5876 1\nFTYP 2 0 1 1 0 0 0\nYFLN 2\nSURF 0\n"
    text += f"  DISZ 400\n  GLAS ___BLANK 1 0 {water} 0\nSURF 1\n  STOP\n  CURV 0.05\n  DISZ 90\n"
    text += f"  GLAS ___BLANK 1 0 {glass} 0\n  DIAM 5 1\n"
    text += f"SURF 2\n  DISZ 0\n  GLAS ___BLANK 1 0 {glass} 0\n"
    zmx = parse_zmx(text)
    assert zmx.notes == ("line 16: the image lies in model:1.5,0.0: light ends there",)
    image = paraxial_image(zmx.lens)
    distance_mm = glass / ((glass - water) * 0.05 - water / 400)
    assert image.distance_mm == pytest.approx(distance_mm, rel=1e-12)
    magnification = -water * distance_mm / (glass * 400)
    assert image.magnification == pytest.approx(magnification, rel=1e-12)
    # the field is a paraxial image height: seen from the first vertex its object is at 2 / |m|
    angle = math.atan(2 / abs(magnification) / 400)
    assert zmx.lens.field_angles_rad == pytest.approx((angle,), rel=1e-12)
    far = parse_zmx(text.replace("DISZ 400", "DISZ INFINITY")).lens
    # n sin u n' u' of the vertex: tan u' = n tan u / n', and the image at f' = n' R / (n' - n)
    focal_mm = glass / ((glass - water) * 0.05)
    assert far.field_angles_rad == pytest.approx((math.atan(2 * glass / water / focal_mm),))


def test_numerical_aperture_of_an_object_in_water_is_that_of_its_index() -> None:
    text = "OBNA 1.0 0\nWAVM 1 0.5876 1\nSURF 0\n  DISZ 3\n  GLAS ___BLANK 1 0 1.333 0\n"
    text += "SURF 1\n  STOP\n  DISZ 1\n  GLAS N-BK7\nSURF 2\n  DISZ 5\nSURF 3\n  DISZ 0\n"
    lens = parse_zmx(text).lens
    assert lens.aperture_value == pytest.approx(2 * 3 * math.tan(math.asin(1 / 1.333)))
    with pytest.raises(DecodeError, match="line 1: OBNA"):
        parse_zmx(text.replace("OBNA 1.0", "OBNA 1.4"))


def test_a_preferred_catalogue_decides_before_that_of_the_file() -> None:
    text = _changed(("GLAS N-BK7", "GLAS F2"))
    assert parse_zmx(text).lens.surfaces[0].glass == "F2-Schott"
    hikari = parse_zmx(text, preferred=preferred_catalogues("hikari,schott")).lens
    assert hikari.surfaces[0].glass == "F2-Hikari"


def test_names_that_no_catalogue_has_are_answered_by_glasses_near_to_their_numbers() -> None:
    text = _changed(("GLAS N-BK7 0 0 0 0 0 0 0 0 0 0", "GLAS MYGLASS 0 0 1.5168 64.17"))
    with pytest.raises(ContractError, match=r"near to its n_d and V_d: .*N-BK7-Schott \(1.51680"):
        parse_zmx(text, rule="names")


def test_a_model_glass_may_have_any_name_and_no_dispersion() -> None:
    text = _changed(("GLAS N-BK7 0 0 0 0 0 0 0 0 0 0", "GLAS Untitled 1 2 1.50801 0"))
    assert parse_zmx(text).lens.surfaces[0].glass == "model:1.50801,0.0"


@pytest.mark.parametrize(
    ("name", "types", "landings_mm"),
    [
        (
            "Ricoh_6.0mm_F1.9_VC_GR_",
            "XASPHERE",
            (0.0003396318644557847, 0.00014450497459039813, -0.0014621627357558342),
        ),
        (
            "Fujifilm_Fujinon_XC15-45mm_F3.5-5.6_OIS_PZ",
            "XOSPHERE",
            (0.01239169233406652, 0.021211298484959507, 0.029076258765521418),
        ),
        (
            "Nikon_AF-S_Zoom-Nikkor_28-70mm_f2.8D_IF-ED",
            "XOSPHERE",
            (-0.00031817910523512793, -0.0033946420008961198, -0.00871415017911481),
        ),
    ],
)
def test_patented_lenses_of_extended_aspheres_focus_as_optiland_has_it(
    name: str, types: str, landings_mm: tuple[float, ...]
) -> None:
    """optiland 0.6.3, its Newton steps end at 1e-7 mm: rays at 0.3, 0.6 and 0.8 of the pupil.

    The fields are left out: aiming is another matter.
    """
    text = read_text(data_path(f"lens_photo/{name}.zmx"))
    assert types in text
    lines = [line for line in text.splitlines() if not line.startswith(("XFLN", "YFLN"))]
    lens = parse_zmx("\n".join(lines)).lens
    tensors = surface_tensors(lens, torch.tensor(lens.reference_wavelength_um, dtype=torch.float64))
    radius = paraxial_data(lens).entrance_pupil_diameter_mm / 2
    y = radius * torch.tensor([0.3, 0.6, 0.8], dtype=torch.float64)
    zero, fate = torch.zeros_like(y), torch.zeros(3, dtype=torch.int8)
    end = trace(tensors, Rays(x=y / 2, y=y, z=zero, l=zero, m=zero, n=zero + 1, fate=fate))
    assert end.y.tolist() == pytest.approx(landings_mm, abs=5e-8)


def test_a_working_f_number_is_known_of_a_far_object_however_far_is_written() -> None:
    lens = parse_zmx(_changed(("ENPD 2.286E+1", "FNUM 4.5 1"))).lens
    far = _changed(("ENPD 2.286E+1", "FNUM 4.5 1"), ("DISZ INFINITY", "DISZ 1E+10"))
    assert parse_zmx(far).lens == lens
    with pytest.raises(UnsupportedError, match="working f-number of a near object"):
        parse_zmx(far.replace("DISZ 1E+10", "DISZ 400"))
