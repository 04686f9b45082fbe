import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.optics.glass.agf import parse_agf
from camkit.models_def.optics.glass.catalogue import find_glass
from camkit.models_def.optics.lens_file.zmx_reader import parse_zmx, read_zmx
from camkit.models_def.optics.lens_file.zmx_writer import format_zmx, write_zmx
from camkit.models_def.optics.prescription import Lens, Surface, read_prescription
from camkit.models_def.optics.shape.phase import Monomial, Phase

PRESCRIPTIONS = Path(__file__).resolve().parents[4] / "models_def" / "prescriptions"
MINE = parse_agf("NM FOO 2 0 1.6 50\nCD 1.4 0.01\nLD 0.3 2\n", "mine")

number = st.floats(-1e3, 1e3, allow_nan=False)
surfaces = st.builds(
    Surface,
    curvature_per_mm=st.floats(-0.2, 0.2, allow_nan=False),
    thickness_mm=number,
    glass=st.sampled_from(
        [
            *("air", "N-BK7-Schott", "F2-Schott", "F2-Hikari", "SF10-Hikari", "SF10-Schott"),
            *("PMMA-Sultanova2009", "PC-Sultanova2009", "PMMA-Misc", "ZnSe-Connolly1979"),
            *("model:1.6,40.1", "model:1.5,0", "model:1.7,33.3,-0.003", "cauchy:1.491756,58"),
            *("N-SF6HTultra-Schott", "Ge-Burnett2016"),
        ]
    ),
    semi_diameter_mm=st.sampled_from([math.inf, 5.5, 3.0]),
    conic=st.floats(-10, 10),
    even_asphere=st.lists(st.floats(1e-30, 1e-3), max_size=8).map(tuple),
)
lenses = st.builds(
    Lens,
    name=st.sampled_from(["one", "a b", "Ø12 µm"]),
    surfaces=st.lists(surfaces, min_size=1, max_size=5).map(tuple),
    stop=st.just(0),
    aperture_kind=st.sampled_from(
        ["f_number", "entrance_pupil_diameter_mm", "stop_semi_diameter_mm"]
    ),
    aperture_value=st.floats(0.1, 100),
    object_distance_mm=st.sampled_from([math.inf, 1000.0, 123.456]),
    field_angles_rad=st.sets(st.floats(0, 1.5), min_size=1, max_size=14).map(
        lambda angles: tuple(sorted(angles))
    ),
    wavelengths_um=st.sets(st.floats(0.4, 1.0), min_size=1, max_size=5).map(
        lambda waves: tuple(sorted(waves))
    ),
    reference_wavelength_um=st.sampled_from([0.55, 0.5875618]),
    note=st.sampled_from(["", "from a book", "two\nlines"]),
)


@settings(max_examples=120, deadline=None)
@given(lens=lenses)
def test_written_lens_reads_back_to_the_last_bit(lens: Lens) -> None:
    back = parse_zmx(format_zmx(lens)).lens
    close = pytest.approx(lens.field_angles_rad, rel=4e-16, abs=1e-300)
    assert back.field_angles_rad == close
    assert replace(back, field_angles_rad=lens.field_angles_rad) == lens


@pytest.mark.parametrize("path", sorted(PRESCRIPTIONS.glob("*.toml")), ids=lambda path: path.stem)
def test_every_prescription_of_camkit_goes_through_the_format(path: Path, tmp_path: Path) -> None:
    lens = read_prescription(path)
    if any(surface.grooves for surface in lens.surfaces):
        with pytest.raises(UnsupportedError, match="grooves"):
            write_zmx(lens, tmp_path / "lens.zmx")
        return
    write_zmx(lens, tmp_path / "lens.zmx")
    assert read_zmx(tmp_path / "lens.zmx").lens == lens


def test_file_is_utf16_with_mark_and_windows_line_ends(tmp_path: Path) -> None:
    write_zmx(read_prescription(PRESCRIPTIONS / "duet.toml"), tmp_path / "lens.zmx")
    data = (tmp_path / "lens.zmx").read_bytes()
    assert data.startswith(b"\xff\xfe")
    assert "\r\nSURF 1\r\n" in data.decode("utf-16")


def test_makers_glass_is_written_by_its_trade_name_and_a_plastic_as_a_model() -> None:
    lens = read_prescription(PRESCRIPTIONS / "cooke-triplet.toml")
    flint = replace(lens.surfaces[2], glass="SK18-Hikari")
    text = format_zmx(replace(lens, surfaces=(*lens.surfaces[2:], flint), stop=0))
    # in the other order F2 would be Hikari's; SK16 is Hikari's, but also a glass of old Schott
    assert "GCAT SCHOTT HIKARI" in text
    assert "GLAS SK18 0 0 1.6385" in text
    assert "GLAS F2 0 0 1.6200" in text
    assert "COMM glass SK16-Hikari" in text
    front = replace(lens.surfaces[0], glass="SF10-Hikari")
    both = (front, replace(front, glass="SF10-Schott"))
    assert "COMM glass SF10-" in format_zmx(replace(lens, surfaces=both, stop=0))
    assert "GLAS N-BK7 0 0 1.5168" in format_zmx(read_prescription(PRESCRIPTIONS / "al2550-a.toml"))


def test_model_glass_changed_by_another_program_counts_as_changed() -> None:
    text = format_zmx(read_prescription(PRESCRIPTIONS / "duet.toml"))
    assert "COMM glass PC-Sultanova2009" in text
    index = text.split("___BLANK 1 0 ")[1].split()[0]
    kept = parse_zmx(text.replace(index, f"{float(index):.12E}")).lens
    changed = parse_zmx(text.replace(index, "1.6")).lens
    assert kept.surfaces[1].glass == "PC-Sultanova2009"
    assert changed.surfaces[1].glass.startswith("model:1.6,")


def test_glass_of_a_users_catalogue_needs_that_catalogue() -> None:
    glass = find_glass("FOO", [MINE])
    front = Surface(curvature_per_mm=0.02, thickness_mm=5, glass=glass.name, material=glass)
    lens = Lens(name="x", surfaces=(front,), stop=0, aperture_kind="f_number", aperture_value=4.0)
    text = format_zmx(lens)
    assert parse_zmx(text, [MINE]).lens == lens
    with pytest.raises(ContractError, match=r"FOO.*glass"):
        parse_zmx(text, rule="names")
    image, glass_note = parse_zmx(text).notes
    assert "the image lies in model:" in image
    assert "FOO is no glass of one catalogue: read by its numbers" in glass_note


@pytest.mark.parametrize(
    ("kind", "numbers"),
    [
        ("ODDASPHE", {"even_asphere": (1e-4, -2e-7), "odd_asphere": (0.01, 1e-5, 3e-7)}),
        ("XASPHERE", {"even_asphere": (0.0, *[1e-9] * 9)}),
        ("XASPHERE", {"even_asphere": (0.1, -0.2), "normal_radius_mm": 7.5}),
        ("XOSPHERE", {"odd_asphere": (0.0, *[1e-9] * 5)}),
        (
            "XOSPHERE",
            {"even_asphere": (0.1,), "odd_asphere": (0.0, 0.3), "normal_radius_mm": 7.5},
        ),
        (
            "BINARY_2",
            {
                "even_asphere": (0.0, 1e-6),
                "phase": Phase(radius_mm=6.0, radial_rad=(-80.0, 0.0, 4.0), order=-1.0),
            },
        ),
    ],
)
def test_shapes_come_back_from_their_types(kind: str, numbers: dict[str, Any]) -> None:
    surface = Surface(curvature_per_mm=0.02, thickness_mm=5, conic=-0.5, **numbers)
    lens = Lens(name="x", surfaces=(surface,), stop=0, aperture_kind="f_number", aperture_value=4.0)
    text = format_zmx(lens)
    assert f"TYPE {kind}" in text
    assert parse_zmx(text).lens == lens


def test_q_con_goes_out_as_the_extended_asphere_that_it_is() -> None:
    surface = Surface(
        curvature_per_mm=0.02, thickness_mm=5, conic=-0.5, q_con=(0.1, -0.05), normal_radius_mm=8.0
    )
    lens = Lens(name="x", surfaces=(surface,), stop=0, aperture_kind="f_number", aperture_value=4.0)
    (back,) = parse_zmx(format_zmx(lens)).lens.surfaces
    assert back.even_asphere == surface.polynomial.even
    assert back.normal_radius_mm == 8.0


def test_what_the_format_cannot_hold_is_refused() -> None:
    lens = read_prescription(PRESCRIPTIONS / "duet.toml")
    front = lens.surfaces[0]
    odd = replace(front, odd_asphere=(0.0, 1e-6))
    best_fit = replace(front, conic=0.0, even_asphere=(), q_bfs=(1e-3,), normal_radius_mm=5.0)
    phase = Phase(radius_mm=5.0, radial_rad=(-10.0,))
    cubic = replace(phase, free_rad=(Monomial(p=3, q=0, coefficient_rad=20.0),))
    for surface, message in (
        (best_fit, "Q_bfs"),
        (replace(front, phase=cubic), "free phase"),
        (replace(odd, phase=phase), "no even one"),
    ):
        with pytest.raises(UnsupportedError, match=f"surface 0 has .*{message}"):
            format_zmx(replace(lens, surfaces=(surface,)))
    off = replace(lens.surfaces[1], index_offset=1e-4)
    with pytest.raises(ContractError, match="nominal"):
        format_zmx(replace(lens, surfaces=(off,)))
