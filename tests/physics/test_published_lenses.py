"""Published lenses through the public analysis: the figures that `camkit lens show` prints."""

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from camkit.cli.app import run
from camkit.cli.exit_code import ExitCode
from camkit.models_def.optics.analysis.curves import distortion
from camkit.models_def.optics.analysis.first_order import AIRY, airy_radius_mm
from camkit.models_def.optics.analysis.sampling import Pupil
from camkit.models_def.optics.analysis.seidel import seidel_sums
from camkit.models_def.optics.analysis.spots import (
    max_from_chief,
    rms_about_centroid,
    rms_about_chief,
    spot_diagram,
)
from camkit.models_def.optics.lens_file.lens_file import read_lens, write_lens
from camkit.models_def.optics.paraxial import paraxial_data, with_paraxial_focus
from camkit.models_def.optics.prescription import Lens, Surface, read_prescription
from camkit.models_def.optics.scaling import with_f_number
from tests.physics.reference_lenses import (
    cooke_triplet,
    thorlabs_aca254,
    thorlabs_al2550,
    thorlabs_la1131,
)

PRESCRIPTIONS = Path(__file__).parents[2] / "models_def" / "prescriptions"
D_LINE_UM = 0.5875618


def _lens(
    radii_mm: Sequence[float], gaps_mm: Sequence[float], glasses: Sequence[str], stop: int = 0
) -> Lens:
    return Lens(
        name="published",
        surfaces=tuple(
            Surface(curvature_per_mm=1 / r, thickness_mm=t, glass=g)
            for r, t, g in zip(radii_mm, gaps_mm, glasses, strict=True)
        ),
        stop=stop,
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=12.5,
        reference_wavelength_um=D_LINE_UM,
    )


def _slopes(*angles_deg: float) -> torch.Tensor:
    return torch.tan(torch.deg2rad(torch.tensor(angles_deg, dtype=torch.float64)))


def _waves(*wavelengths_um: float) -> torch.Tensor:
    return torch.tensor(wavelengths_um, dtype=torch.float64)


def _rounded_double_gauss() -> Lens:
    """The double Gauss with the listing's printed digits, as optiland ships it."""
    lens = read_prescription(PRESCRIPTIONS / "double-gauss-f2.toml")
    return replace(
        lens,
        reference_wavelength_um=0.5876,
        surfaces=tuple(
            replace(
                s,
                curvature_per_mm=s.curvature_per_mm and 1 / round(1 / s.curvature_per_mm, 5),
                thickness_mm=round(s.thickness_mm, 6),
            )
            for s in lens.surfaces
        ),
    )


@pytest.mark.parametrize("suffix", [".toml", ".zmx"])
def test_al2550_focuses_its_whole_pupil_to_63_picometres(suffix: str, tmp_path: Path) -> None:
    """From a file, by the public spot diagram, to 1 % of what the maker's file says."""
    path = tmp_path / f"al2550{suffix}"
    write_lens(replace(thorlabs_al2550(), wavelengths_um=(0.78,)), path)
    lens = read_lens(path)
    spots = spot_diagram(lens, _slopes(0.0), _waves(0.78), Pupil())
    assert float(max_from_chief(spots)) == pytest.approx(6.28616e-8, rel=1e-2)
    assert paraxial_data(lens).f_number == pytest.approx(1 / (2 * 0.230), rel=2e-3)


@pytest.mark.parametrize(
    ("lens", "rms_mm"),
    [
        (thorlabs_al2550(), (8.325e-5, 0.20793, 0.90726, 2.40572)),
        (thorlabs_aca254(), (3.5400e-3, 0.23028, 1.00138, 2.69616)),
    ],
    ids=["AL2550-A", "ACA254-050-A"],
)
def test_singlet_and_doublet_at_f4_are_sharp_on_the_axis_and_lost_at_30_degrees(
    lens: Lens, rms_mm: Sequence[float]
) -> None:
    """An independent tracer's spots at 0, 10, 20 and 30 degrees, image at the paraxial focus."""
    bare = tuple(replace(s, semi_diameter_mm=math.inf) for s in lens.surfaces)
    at_f4 = replace(lens, aperture_value=12.5, reference_wavelength_um=0.55, surfaces=bare)
    spots = spot_diagram(with_paraxial_focus(at_f4), _slopes(0, 10, 20, 30), _waves(0.55), Pupil())
    assert rms_about_centroid(spots)[:, 0].tolist() == pytest.approx(rms_mm, rel=6e-5)


def test_la1131_has_its_published_focal_lengths() -> None:
    data = paraxial_data(thorlabs_la1131(), 0.5876)
    assert (data.efl_mm, data.bfl_mm) == pytest.approx((49.82600200, 46.30542875), abs=5e-9)


def test_la1131_is_widest_at_its_rim_as_the_maker_s_file_says() -> None:
    spots = spot_diagram(thorlabs_la1131(), _slopes(0.0), _waves(0.4861, 0.5876), Pupil())
    expected = [0.3584516158236, 0.2295233206]
    assert max_from_chief(spots)[0].tolist() == pytest.approx(expected, abs=6e-11)


def test_singlet_with_its_stop_behind_equals_zemax() -> None:
    """Hoya's LAC9; spots per wavelength about the chief ray of the d line."""
    lens = replace(
        _lens((63.73364157, 653.29392320), (10, 92.73834630), ("LAC9-Hoya", "air"), stop=1),
        aperture_value=25.0,
    )
    assert paraxial_data(lens).efl_mm == pytest.approx(101.501825949, abs=6e-10)
    waves = _waves(0.4861327, D_LINE_UM, 0.6562725)
    spots = spot_diagram(lens, _slopes(0.0), waves, Pupil())
    rms, largest = rms_about_chief(spots)[0].tolist(), max_from_chief(spots)[0].tolist()
    assert rms == pytest.approx([0.032252, 0.137509, 0.188229], abs=6e-7)
    assert largest == pytest.approx([0.046552, 0.156289, 0.214543], abs=6e-7)


def test_aspheric_singlet_s_r2_term_moves_its_focal_length() -> None:
    """N-SF11 at 0.587 um: 25.484006 mm is what a program that forgets the term reports."""
    front = Surface(
        curvature_per_mm=1 / 20,
        thickness_mm=7.0,
        glass="N-SF11-Schott",
        even_asphere=(-2.248851e-4, -4.690412e-6, -6.404376e-8),
    )
    plane = Surface(curvature_per_mm=0.0, thickness_mm=20.0)
    lens = replace(_lens((1.0,), (1.0,), ("air",)), surfaces=(front, plane))
    assert paraxial_data(lens, 0.587).efl_mm == pytest.approx(25.7153, abs=5e-5)
    forgetful = replace(lens, surfaces=(replace(front, even_asphere=()), plane))
    assert paraxial_data(forgetful, 0.587).efl_mm == pytest.approx(25.484006, abs=6e-7)


def test_oslo_triplet_has_the_published_first_order_and_spot() -> None:
    """Rayopt asserts the first order to 0.5 %, the spot at 20 degrees to 1 %.

    It aims the pupil's edge at that of the stop, image at the paraxial focus: our `stop`. Filled
    by the paraxial pupil the same field has 0.0414 mm, about an aimed chief ray 0.0419 mm.
    """
    lens = _lens(
        (21.25, -158.65, -20.25, 19.6, math.inf, 141.25, -17.285),
        (2, 6, 1, 0, 6, 2, 42.95),
        ("N-SK16-Schott", "air", "N-F2-Schott", "air", "air", "N-SK16-Schott", "air"),
        stop=4,
    )
    data = paraxial_data(lens)
    assert data.efl_mm == pytest.approx(50, rel=5e-3)
    assert data.efl_mm == pytest.approx(49.8, abs=0.05)
    # its NA is the sine of the paraxial marginal ray's angle
    assert math.sin(math.atan(6.25 / data.efl_mm)) == pytest.approx(0.124, rel=5e-3)
    pupil = Pupil(definition="stop", sampling="gauss:16x32")
    focused = with_paraxial_focus(lens)
    found = rms_about_centroid(spot_diagram(focused, _slopes(20.0), _waves(D_LINE_UM), pupil))
    assert float(found) == pytest.approx(0.052, rel=1e-2)


def test_deeplens_triplet_has_its_true_paraxial_focal_lengths() -> None:
    """Its own program finds 49.853 to 49.857 mm by random real rays."""
    curvatures = (0.0454, -0.0023, -0.045, 0.0493, 0.0, 0.0125, -0.0544)
    lens = _lens(
        [1 / c if c else math.inf for c in curvatures],
        (3.259, 6.008, 1.0, 2.118, 2.75, 2.952, 42.0),
        ("N-SK16-Schott", "air", "F2-Schott", "air", "air", "N-SK16-Schott", "air"),
        stop=4,
    )
    data = paraxial_data(lens, 0.587)
    assert (data.efl_mm, data.bfl_mm) == pytest.approx((49.87474, 42.41330), abs=5e-6)


def test_cooke_triplet_of_another_melt_has_another_focal_length() -> None:
    lens = cooke_triplet()
    schott = tuple(
        replace(s, glass="N-SK16-Schott") if s.glass == "SK16-Hikari" else s for s in lens.surfaces
    )
    assert paraxial_data(replace(lens, surfaces=schott)).efl_mm == pytest.approx(
        49.999982, abs=6e-7
    )


def test_sample_doublet_has_the_focus_and_spot_that_opticstudio_stored_in_its_file() -> None:
    """EPD 20 mm, old glasses; the sensor stands where a solve of the ray height put it."""
    curvatures = (1.077039960779e-2, -3.255623054352e-2, -1.2788164132877849e-2)
    lens = replace(
        _lens(
            [1 / c for c in curvatures],
            (6.0, 3.0, 97.37604742911),
            ("BK7-Schott1983", "F2-Schott", "air"),
        ),
        aperture_value=20.0,
        reference_wavelength_um=0.589,
    )
    assert paraxial_data(lens).bfl_mm == pytest.approx(97.37604742911, abs=6e-11)
    spots = spot_diagram(lens, _slopes(0.0), _waves(0.486, 0.589, 0.656), Pupil())
    assert float(max_from_chief(spots).max()) == pytest.approx(8.437369439982e-3, abs=6e-12)


def test_sample_cooke_triplet_reaches_as_far_as_opticstudio_stored_in_its_file() -> None:
    """The image's semi-diameter: the farthest ray of three fields and wavelengths."""
    curvatures = (0.0454264791, -0.0022948389, -0.045018121)
    more = (0.0492806889, 0.0125496334, -0.054361615610838313)
    gaps_mm = (3.25895583, 6.0075511, 0.999974567, 4.75040893, 2.95207564, 42.2077801)
    glasses = ("SK16-Schott1983", "air", "F2-Schott", "air", "SK16-Schott1983", "air")
    lens = replace(
        _lens([1 / c for c in (*curvatures, *more)], gaps_mm, glasses, stop=3),
        aperture_value=10.0,
        reference_wavelength_um=0.55,
    )
    spots = spot_diagram(lens, _slopes(0, 14, 20), _waves(0.48, 0.55, 0.65), Pupil())
    assert float(spots.y_mm.max()) == pytest.approx(18.17265834502, abs=6e-9)


def test_airy_radius_of_the_cooke_triplet_equals_optiland() -> None:
    """Printed with the rounded zero 1.22 of the Bessel function."""
    found = airy_radius_mm(cooke_triplet()) * 1.22 / AIRY
    assert found == pytest.approx(0.0033403700, abs=6e-10)


def test_double_gauss_at_f5_equals_optiland() -> None:
    """Seidel sums, exit pupil and EFL to the digits printed, from a listing of as many digits."""
    lens = _rounded_double_gauss()
    assert paraxial_data(lens).efl_mm == pytest.approx(100.00374787, abs=6e-9)
    slow = replace(with_f_number(lens, 5.0), field_angles_rad=(0.0, math.radians(14)))
    sums = seidel_sums(with_paraxial_focus(slow)).sums_mm.tolist()
    printed = [-0.003929457876, 0.000395459763, 0.003423905503, -0.016264753735, -0.046484107477]
    assert sums == pytest.approx(printed, abs=6e-13)
    data = paraxial_data(slow)
    assert data.exit_pupil_diameter_mm == pytest.approx(22.92888544, abs=6e-9)
    # the listing's image distance, to its last digit
    assert data.exit_pupil_mm - 61.487536 == pytest.approx(-114.64441695, abs=6e-9)


def test_double_gauss_distortion_is_code_v_s_by_both_definitions() -> None:
    """The sensor stands 0.4 mm inside the focus, so it matters where the ideal image is.

    Camkit compares with the paraxial chief ray on the sensor (24.846684 in the listing); CODE V
    takes f tan in the paraxial focus and carries it to the sensor along the real chief ray.
    """
    lens = replace(
        read_prescription(PRESCRIPTIONS / "double-gauss-f2.toml"), reference_wavelength_um=0.5876
    )
    slopes, wave = _slopes(10.0, 14.0), _waves(0.5876)
    found = distortion(lens, slopes, wave, "stop")[:, 0].tolist()
    assert found[1] == pytest.approx(24.588739 / 24.846684 - 1, abs=1e-7)
    real = torch.tensor([17.485856, 24.588739], dtype=torch.float64)
    exit_slope = torch.tensor([0.150057, 0.206467], dtype=torch.float64)
    data = paraxial_data(lens)
    defocus = lens.surfaces[-1].thickness_mm - data.bfl_mm
    carried = data.efl_mm * slopes + defocus * exit_slope
    listed = (100 * (real / carried - 1)).tolist()
    assert listed == pytest.approx([-0.4976, -1.0557], abs=6e-5)


@pytest.mark.parametrize(
    ("pupil", "suffix", "rms_um"),
    [
        ("paraxial", ".toml", (4.2937, 16.7867, 12.0813)),
        ("chief", ".zmx", (4.2937, 16.5807, 12.2945)),
        ("stop", ".zmx", (4.2728, 17.7087, 16.3212)),
    ],
)
def test_lens_show_states_the_pupil_that_decides_the_cooke_triplet_s_spots(
    pupil: str,
    suffix: str,
    rms_um: Sequence[float],
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    """One lens, three answers at 20 degrees: 12.08, 12.29 and 16.32 um."""
    path = tmp_path / f"cooke{suffix}"
    write_lens(read_prescription(PRESCRIPTIONS / "cooke-triplet-f5.toml"), path)
    assert (
        run(["lens", "show", "--sampling", "hexapolar:6", str(path), "--json", "--pupil", pupil])
        == ExitCode.DONE
    )
    found = json.loads(capsys.readouterr().out)
    assert found["pupil"] == pupil
    assert found["efl_mm"] == pytest.approx(49.9997830714, abs=1e-9)
    primary = [f for f in found["fields"] if f["wavelength_um"] == 0.55]
    assert [1000 * f["spot_rms_mm"] for f in primary] == pytest.approx(rms_um, abs=6e-5)


def test_lens_show_prints_the_cooke_triplet_s_other_colours(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """By optiland about the chief ray of 0.55 um, and how far the outermost ray lies from it."""
    path = PRESCRIPTIONS / "cooke-triplet-f5.toml"
    assert run(["lens", "show", "--sampling", "hexapolar:6", str(path), "--json"]) == ExitCode.DONE
    fields = json.loads(capsys.readouterr().out)["fields"]
    by_wave = {w: [f for f in fields if f["wavelength_um"] == w] for w in (0.48, 0.55, 0.65)}
    blue, green, red = ([f["spot_rms_chief_mm"] for f in by_wave[w]] for w in (0.48, 0.55, 0.65))
    assert blue == pytest.approx([0.003791335, 0.015824800, 0.013236233], abs=6e-10)
    assert green == pytest.approx([0.0042936896, 0.0169184128, 0.0121166886], abs=6e-11)
    assert red == pytest.approx([0.006195619, 0.019221166, 0.013648685], abs=6e-10)
    largest = [f["spot_max_mm"] for f in by_wave[0.55]]
    assert largest == pytest.approx([0.0062864577, 0.0407529516, 0.0225018474], abs=6e-11)
