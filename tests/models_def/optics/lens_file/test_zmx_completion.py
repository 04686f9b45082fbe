"""Files that leave out object, image, stop, aperture or wavelengths."""

import math

import pytest

from camkit.errors import DecodeError
from camkit.models_def.optics.glass.dispersion import C_LINE_UM, D_LINE_UM, F_LINE_UM
from camkit.models_def.optics.lens_file.zmx_reader import parse_zmx, read_zmx
from camkit.models_def.optics.paraxial import paraxial_data
from tests.data_folder import data_path
from tests.zmx_factory import LA1131

DOUBLET = """NAME close-up lens
MODE SEQ
UNIT MM
SURF 1
  TYPE STANDARD
  CURV 0.0125
  DISZ 9
  DIAM 30
  GLAS ___BLANK 1 0 1.6 60
SURF 2
  TYPE STANDARD
  CURV -0.004
  DISZ 3
  DIAM 28
  GLAS ___BLANK 1 0 1.65 34
SURF 3
  TYPE STANDARD
  CURV 0.005
  DISZ 200
  DIAM 29
"""
EYEPIECE = """MODE SEQ
SURF 0
  CURV 0
  DISZ 7
  DIAM 12
  GLAS Untitled 1 2 1.5 0
SURF 1
  CURV -0.02
  DISZ 0
  DIAM 14
SURF 2
  CURV 0.01
  DISZ 0
  DIAM 14
"""


def test_a_list_that_begins_at_surf_1_has_a_distant_object_and_an_image_behind() -> None:
    zmx = parse_zmx(DOUBLET)
    lens = zmx.lens
    assert [s.thickness_mm for s in lens.surfaces] == [9, 3, 200]
    assert lens.object_distance_mm == math.inf
    assert lens.wavelengths_um == (F_LINE_UM, D_LINE_UM, C_LINE_UM)
    assert lens.reference_wavelength_um == D_LINE_UM
    assert (lens.stop, lens.aperture_kind) == (1, "stop_semi_diameter_mm")
    assert lens.aperture_value == 28
    listed, stop, aperture = zmx.notes
    assert "object is at infinity" in listed
    assert stop.startswith("no surface holds STOP: surface 2 is taken")
    assert "(28 mm)" in aperture


def test_a_list_that_begins_with_a_glass_is_a_lens_and_no_object_in_glass() -> None:
    """A plano-convex lens of n = 1.5 and R = 50: f = 100, its focus 100 mm behind the vertex."""
    zmx = parse_zmx(EYEPIECE)
    assert zmx.lens.object_glass == "air"
    assert [s.glass for s in zmx.lens.surfaces] == ["model:1.5,0.0", "air", "air"]
    assert paraxial_data(zmx.lens).efl_mm == pytest.approx(100, rel=1e-12)
    # the last surface states no way to the image: the focus is taken
    assert zmx.lens.surfaces[-1].thickness_mm == pytest.approx(100, rel=1e-12)
    assert any("the sensor is at the focus, 100 mm" in note for note in zmx.notes)


def test_a_virtual_image_of_a_list_is_noted_and_the_gap_stays() -> None:
    zmx = parse_zmx(EYEPIECE.replace("CURV -0.02", "CURV 0.02"))
    assert zmx.lens.surfaces[-1].thickness_mm == 0
    assert "the paraxial image lies 100 mm in front of the last vertex" in zmx.notes


def test_a_file_that_states_a_system_has_its_object_in_glass() -> None:
    system = "ENPD 3\nWAVM 1 0.55 1\n"
    text = system + EYEPIECE + "SURF 3\n  DISZ 0\n"
    lens = parse_zmx(text.replace("SURF 1\n", "SURF 1\n  STOP\n")).lens
    assert lens.object_glass == "model:1.5,0.0"
    assert lens.object_distance_mm == 7


def test_without_stop_the_surface_of_least_clear_radius_is_taken() -> None:
    zmx = parse_zmx(LA1131.replace("  STOP\n", ""))
    assert zmx.lens.stop == 1
    assert zmx.notes[0].startswith("no surface holds STOP: surface 2 is taken, the one of least")
    bare = "\n".join(line for line in LA1131.splitlines() if "DIAM" not in line)
    zmx = parse_zmx(bare.replace("  STOP\n", ""))
    assert (zmx.lens.stop, zmx.lens.aperture_value) == (0, 22.86)
    assert "the first one, since none states a clear radius" in zmx.notes[0]


def test_without_aperture_the_stop_is_open_to_its_clear_radius() -> None:
    zmx = parse_zmx(LA1131.replace("ENPD 2.286E+1\n", ""))
    assert (zmx.lens.aperture_kind, zmx.lens.aperture_value) == ("stop_semi_diameter_mm", 12.7)
    assert zmx.notes == ("no aperture: the stop is open to its clear radius (12.7 mm)",)
    bare = "\n".join(line for line in LA1131.splitlines() if "DIAM" not in line)
    with pytest.raises(DecodeError, match=r"aperture must be one of .* got none"):
        parse_zmx(bare.replace("ENPD 2.286E+1\n", ""))


def test_a_file_with_a_system_and_no_wavelength_is_still_damaged() -> None:
    text = "\n".join(line for line in LA1131.splitlines() if not line.startswith("WAVM"))
    with pytest.raises(DecodeError, match="states no wavelength"):
        parse_zmx(text)


@pytest.mark.parametrize(
    ("file", "efl_mm"),
    [
        # the patent of the eyepiece states lengths for a focal length of 100
        ("Konig_USP873870.zmx", 100.0),
        # what optiland 0.6.3 has for the same surfaces
        ("Canon_250D_72mm_.zmx", 243.853),
        ("Huygens.zmx", 99.0893),
        ("Canon_Extender_EF1.4X_III.zmx", -115.780),
    ],
)
def test_files_of_others_without_a_system_have_the_focal_lengths_of_their_surfaces(
    file: str, efl_mm: float
) -> None:
    lens = read_zmx(data_path(f"lens_photo/{file}")).lens
    assert paraxial_data(lens).efl_mm == pytest.approx(efl_mm, rel=2e-5)


def test_files_of_others_with_the_image_in_water_are_read() -> None:
    zmx = read_zmx(data_path("lens_zmx/COTS-0002-02-1.zmx"))
    assert zmx.lens.surfaces[-1].glass.startswith("model:1.333")
    # optiland's own reader has 11.1011 mm with its B270, 2e-5 off ours in index
    assert paraxial_data(zmx.lens).efl_mm == pytest.approx(11.1011, rel=2e-4)
