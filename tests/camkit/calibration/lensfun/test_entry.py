"""What is written for lensfun is what was measured, and reads back so."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camkit.bundle.sensor import Extent
from camkit.bundle.writer import write_bundle
from camkit.calibration.lensfun.database import Database
from camkit.calibration.lensfun.entry import (
    EntryOptions,
    Name,
    fit_distortion,
    fit_vignetting,
    lensfun_entry,
    to_xml,
)
from camkit.calibration.lensfun.models import Distortion, Vignetting
from camkit.calibration.lensfun.source import Source, read_source
from camkit.calibration.record import to_toml
from camkit.errors import ContractError, DecodeError
from camkit.radial import RadialDistortion, RadialIllumination
from camkit.runtime.geometry.distortion import distort_points
from tests.bundle_factory import tiny_sensor, write_tiny_bundle
from tests.data_folder import data_path
from tests.lensfun_factory import write_database
from tests.profile_bundle import profile_manifest, tiny_profile

AGREES_PX = 1e-3
SIZE = (600, 400)
MODELS = [("ptlens", (0.02, -0.06, 0.03)), ("poly3", (-0.05,)), ("poly5", (-0.03, 0.004))]
NAME = Name(maker="Example", model="Own & 50mm", mount="Generic", crop_factor=1.5)


def _source(odd: tuple[float, ...], even: tuple[float, ...] | None = None) -> Source:
    return Source(
        name="own",
        size_px=SIZE,
        crop_factor=1.5,
        distortion=RadialDistortion(
            coefficients=np.array([odd]),
            radius_mm=200.0,
            even_coefficients=None if even is None else np.array([even]),
        ),
        light=None,
        notes=(),
    )


@pytest.mark.parametrize(("model", "terms"), MODELS)
def test_a_distortion_that_is_a_model_is_found_again(model: str, terms: tuple[float, ...]) -> None:
    entry = Distortion(model=model, focal_mm=50.0, terms=terms).to_radial(200.0, 1)
    even = None if entry.even_coefficients is None else entry.even_coefficients[0]
    fit = fit_distortion(_source(entry.coefficients[0], even), 50.0)
    assert fit.distortion.model == model
    np.testing.assert_allclose(fit.distortion.terms, terms, atol=1e-6)
    assert fit.scale == pytest.approx(1.0, abs=1e-6)
    assert fit.residual_px < AGREES_PX


@pytest.mark.parametrize("xi", [0.9, 1.0, 1.2])
def test_the_scale_of_the_ideal_picture_does_not_count(xi: float) -> None:
    k1, k2 = -0.03, 0.004
    fit = fit_distortion(_source((xi, k1 * xi**3, k2 * xi**5, 0.0)), 50.0)
    assert fit.residual_px < AGREES_PX
    ideal = np.linspace(0, 1.7, 100)
    placed = fit.distortion.captured_radius(fit.scale * ideal)
    wanted = distort_points(
        np.stack([ideal, ideal * 0], -1),
        RadialDistortion(coefficients=np.array([[xi, k1 * xi**3, k2 * xi**5, 0.0]]), radius_mm=1.0),
        channel=0,
    )
    np.testing.assert_allclose(placed, wanted[:, 0], atol=AGREES_PX / 200)


def test_the_stated_residual_is_the_most_that_the_model_misses() -> None:
    source = _source((1.0, -0.02, 0.015, -0.003))
    fit = fit_distortion(source, 50.0)
    ideal = np.linspace(0, 2.0, 4000)
    assert source.distortion is not None
    points = np.stack([ideal, ideal * 0], -1) * 200
    wanted = distort_points(points, source.distortion, channel=0)[:, 0]
    seen = wanted <= source.corner_px
    missed = np.abs(fit.distortion.captured_radius(fit.scale * ideal) * 200 - wanted)[seen].max()
    assert fit.residual_px > 0.01
    assert fit.residual_px == pytest.approx(missed, rel=0.02)


def test_a_distortion_that_folds_or_is_none_is_refused() -> None:
    with pytest.raises(DecodeError, match="own: the distortion folds"):
        fit_distortion(_source((1.0, -0.3, 0.0, 0.0)), 50.0)
    with pytest.raises(DecodeError, match="own states no distortion"):
        fit_distortion(
            Source(name="own", size_px=SIZE, crop_factor=1, distortion=None, light=None, notes=()),
            50.0,
        )


def test_vignetting_of_the_model_is_found_again() -> None:
    u = np.linspace(0, 1, 513)
    light = 1 - 0.9 * u + 0.3 * u**2 - 0.1 * u**3
    known = RadialIllumination(heights_mm=360 * np.sqrt(u), light=light)
    made, missed = fit_vignetting(known, 360.0, 50.0, 2.8)
    np.testing.assert_allclose(made.terms, (-0.9, 0.3, -0.1), atol=1e-3)
    assert missed < 1e-5


@pytest.mark.parametrize(("model", "terms"), MODELS)
def test_what_is_written_reads_back(tmp_path: Path, model: str, terms: tuple[float, ...]) -> None:
    entry = Distortion(model=model, focal_mm=50.0, terms=terms)
    light = Vignetting(focal_mm=50.0, aperture=2.8, distance_m=1000.0, terms=(-0.9, 0.3, -0.1))
    path = tmp_path / "own.xml"
    path.write_text(to_xml(NAME, SIZE, entry, light), encoding="utf-8")
    (lens,) = Database(path).find("Own & 50mm")
    assert (lens.distortion, lens.vignetting) == ((entry,), (light,))
    assert (lens.crop_factor, lens.aspect) == (1.5, 1.5)


def _structure(root: Any) -> set[tuple[str, str, tuple[str, ...]]]:
    """Give parent, element and attributes, as they occur."""
    return {
        (parent.tag, child.tag, tuple(sorted(child.attrib)))
        for parent in root.iter()
        for child in parent
    }


def test_the_file_has_the_structure_of_those_of_the_database(tmp_path: Path) -> None:
    from camkit.calibration.lensfun.xml import parse_xml, read_xml

    known = set()
    for path in sorted(data_path("lens/lensfun_db").glob("*.xml")):
        known |= _structure(read_xml(path))
    light = Vignetting(focal_mm=50.0, aperture=2.8, distance_m=1000.0, terms=(-0.9, 0.3, -0.1))
    for model, terms in MODELS:
        entry = Distortion(model=model, focal_mm=50.0, terms=terms)
        made = parse_xml(to_xml(NAME, SIZE, entry, light).encode(), "x.xml")
        assert _structure(made) <= known
        order = [child.tag for child in made[0]]
        assert order == ["maker", "model", "mount", "cropfactor", "aspect-ratio", "calibration"]


def test_a_bundle_is_read_in_pixels(tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path / "plain.camkit", profile_manifest(), {})
    source = read_source(bundle.path)
    assert source.distortion is not None
    assert source.light is not None
    assert source.distortion.radius_mm == pytest.approx(0.35 / 0.006)
    np.testing.assert_allclose(source.light.heights_mm, np.array([0, 0.2, 0.4]) / 0.006)
    traced = read_source(write_tiny_bundle(tmp_path))
    assert traced.light is not None
    np.testing.assert_allclose(traced.light.light, [1.0, 0.8])


def test_what_lensfun_cannot_say_is_told(tmp_path: Path) -> None:
    one = tiny_profile().distortion
    assert one is not None
    rows = ((1.01, -0.03, 0.0, 0.0), *one.coefficients[1:])
    extent = Extent(width_px=96, height_px=64, pixel_pitch_um=6.0, optical_centre_px=(50.5, 31.5))
    manifest = profile_manifest(
        optics=tiny_profile(distortion=one.model_copy(update={"coefficients": rows})),
        sensor=tiny_sensor().model_copy(update={"extent": extent}),
    )
    notes = read_source(write_bundle(tmp_path / "x.camkit", manifest, {}).path).notes
    assert any("lateral colour is left out" in note for note in notes)
    assert any("optical centre lies 3.0 px off the middle" in note for note in notes)


GEOMETRY: dict[str, Any] = {
    "width_px": 600,
    "height_px": 400,
    "model": "radial_2",
    "centre_px": [299.5, 199.5],
    "covered_radius_px": 250.0,
    "radial": {"coefficients": [1.0, -0.05, 0.01, 0.0], "radius_px": 360.5, "residual_px": 0.01},
}


def test_a_measured_geometry_is_read(tmp_path: Path) -> None:
    path = tmp_path / "camera.toml"
    path.write_text(to_toml(GEOMETRY), encoding="utf-8")
    source = read_source(path)
    assert (source.name, source.size_px, source.crop_factor) == ("camera", (600, 400), None)
    assert source.distortion is not None
    assert source.distortion.radius_mm == 360.5
    assert any("known to 250 px of 360" in note for note in source.notes)
    assert fit_distortion(source, 50.0).residual_px < 0.1


@pytest.mark.parametrize(
    "change",
    [
        lambda record: record.pop("radial"),
        lambda record: record.update(radial=3),
        lambda record: record.update(width_px="x"),
        lambda record: record.update(width_px=0),
        lambda record: record.update(width_px=10**9),
        lambda record: record.update(centre_px=[1.0]),
        lambda record: record["radial"].update(coefficients=[1.0, 2.0]),
        lambda record: record["radial"].update(coefficients=["x"] * 4),
        lambda record: record["radial"].update(radius_px=-1.0),
    ],
)
def test_what_is_no_geometry_is_refused(
    tmp_path: Path, change: Callable[[dict[str, Any]], None]
) -> None:
    record = json.loads(json.dumps(GEOMETRY))
    change(record)
    path = tmp_path / "camera.toml"
    path.write_text(to_toml(record), encoding="utf-8")
    with pytest.raises(DecodeError, match=r"camera\.toml"):
        read_source(path)


def test_what_is_no_toml_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "camera.toml"
    with pytest.raises(DecodeError, match="cannot read"):
        read_source(path)
    path.write_bytes(b"\xff\xfe = [")
    with pytest.raises(DecodeError, match="is not valid TOML"):
        read_source(path)


def test_the_factory_database_holds_every_model(tmp_path: Path) -> None:
    database = Database(write_database(tmp_path))
    assert {one.model for name in ("Folding 8mm", "Small 50mm") for one in database.find(name)[0].distortion} == {"poly3", "poly5"}  # noqa: E501 # fmt: skip


def test_the_entry_of_a_bundle_is_what_its_parts_give(tmp_path: Path) -> None:
    path = write_bundle(tmp_path / "plain.camkit", profile_manifest(), {}).path
    source = read_source(path)
    made = lensfun_entry(path, EntryOptions(focal_mm=50.0, aperture=2.8))
    assert made.fit == fit_distortion(source, 50.0)
    assert made.vignetting is not None
    light, missed = made.vignetting
    assert (made.name.model, made.name.maker, made.name.mount) == (
        source.name,
        "Generic",
        "Generic",
    )
    assert made.name.crop_factor == source.crop_factor
    assert made.to_xml() == to_xml(made.name, source.size_px, made.fit.distortion, light)
    record = json.loads(json.dumps(made.to_record(), allow_nan=False))
    assert record["vignetting"] == {"terms": list(light.terms), "residual": missed}
    assert record["notes"] == list(source.notes)
    bare = lensfun_entry(path, EntryOptions(focal_mm=50.0, crop_factor=1.7, lens_name="Own"))
    assert (bare.name.model, bare.name.crop_factor, bare.vignetting) == ("Own", 1.7, None)
    assert bare.notes[-1] == "vignetting is left out: it needs aperture"


def test_an_entry_of_a_geometry_needs_its_crop_factor_and_obeys_the_limit(tmp_path: Path) -> None:
    path = tmp_path / "camera.toml"
    path.write_text(to_toml(GEOMETRY), encoding="utf-8")
    with pytest.raises(
        ContractError, match="does not state the size of the sensor: add crop_factor"
    ):
        lensfun_entry(path, EntryOptions(focal_mm=10.0))
    made = lensfun_entry(path, EntryOptions(focal_mm=10.0, crop_factor=1.5))
    assert made.fit.residual_px > 0
    least = EntryOptions(focal_mm=10.0, crop_factor=1.5, most_residual_px=made.fit.residual_px / 2)
    with pytest.raises(DecodeError, match="misses the distortion of camera"):
        lensfun_entry(path, least)


@pytest.mark.parametrize(
    "wrong",
    [
        {"focal_mm": 0.0},
        {"focal_mm": float("nan")},
        {"crop_factor": -1.0},
        {"aperture": float("inf")},
        {"most_residual_px": 0.0},
        {"maker": " "},
        {"mount": ""},
        {"lens_name": "a\nb"},
    ],
)
def test_options_that_no_entry_can_say_are_named(wrong: dict[str, Any]) -> None:
    with pytest.raises(ContractError, match=next(iter(wrong))):
        EntryOptions(**({"focal_mm": 50.0} | wrong))
