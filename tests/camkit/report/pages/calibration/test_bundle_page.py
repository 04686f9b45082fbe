"""The page of a bundle with measured parts: its curves are those of the two bundles."""

from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.chain import rewired
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.writer import write_bundle
from camkit.calibration.measured_files import read_flat, read_geometry, read_noise
from camkit.export.remeasured import Measured, remeasured
from camkit.report.figure import CHANNEL_COLORS
from camkit.report.pages.calibration.bundle_page import (
    Curve,
    bundle_html,
    draw,
    encircled_light,
    light,
    outward_shift,
)
from tests.bundle_factory import write_tiny_bundle
from tests.camkit.cli.use.test_calibrate_bundle import (
    FLAT,
    GEOMETRY,
    NOISE,
    measured_point,
    write_part,
)
from tests.profile_bundle import profile_manifest, profile_stages, tiny_profile


@pytest.fixture(name="two", scope="module")
def two_bundles(tmp_path_factory: pytest.TempPathFactory) -> tuple[Bundle, Bundle]:
    folder = tmp_path_factory.mktemp("bundles")
    before = open_bundle(write_tiny_bundle(folder))
    measured = Measured(
        geometry=read_geometry(write_part(folder, "geometry", GEOMETRY)),
        flat=read_flat(write_part(folder, "flat", FLAT)),
        noise=read_noise(write_part(folder, "noise", NOISE)),
    )
    return before, remeasured(before, measured, folder / "mine.camkit")[0]


def test_colours_of_the_sensor_are_drawn_in_theirs() -> None:
    at = np.arange(3.0)
    curve = Curve(radius=at, original=at, now=at)
    above, _ = draw([curve] * 3, "across", "up", ("R", "G", "B")).axes
    drawn = [line.get_color() for line in above.lines]
    assert drawn == [color for color in CHANNEL_COLORS.values() for _ in range(2)]


def test_curves_are_those_of_both_bundles(two: tuple[Bundle, Bundle]) -> None:
    before, made = two
    curve = outward_shift(before, made)
    r = curve.radius / 57.7
    np.testing.assert_allclose(curve.now, -57.7 * 0.02 * r**3, atol=1e-6)
    assert np.abs(curve.now - curve.original).max() > 0.1
    curve = light(before, made)
    assert curve.now[0] == pytest.approx(1)
    assert curve.now[-1] == pytest.approx(0.7)
    known = before.psf
    assert curve.original[-1] == pytest.approx(known.relative_illumination[-1])
    drawn = draw([curve], "across", "up").axes
    np.testing.assert_allclose(drawn[1].get_lines()[0].get_ydata(), curve.now - curve.original)


def test_every_part_has_a_section(two: tuple[Bundle, Bundle]) -> None:
    before, made = two
    record = {
        "measured": {"geometry": "g.toml", "flat": "f.toml", "noise": "n.toml"},
        "model": "radial_2",
        "residual_px": 0.02,
        "networks": ["M"],
        "golden": ["typical"],
        "left_out": ["card.md"],
        "notes": ["a <note>"],
    }
    page = bundle_html(before, made, record)
    for title in ("From tiny", "Geometry", "Vignetting", "Noise"):
        assert f"<h2>{title}</h2>" in page
    assert page.count("<img") == 2
    for told in ("A &lt;note&gt;.", "50.00, 30.00", "ISO 400: gain, e- per DN", "g.toml"):
        assert told in page
    assert "Kernels" not in page


def test_kernels_hold_all_light_within_their_corner(tmp_path: Path) -> None:
    before = open_bundle(write_tiny_bundle(tmp_path))
    made, _ = remeasured(before, Measured(psf=measured_point()), tmp_path / "mine.camkit")
    for shares in (*encircled_light(before), *encircled_light(made)):
        assert shares[-1] == pytest.approx(1, abs=1e-5)
        assert (np.diff(shares) >= 0).all()
    red, green, blue = (shares[0] for shares in encircled_light(made))
    assert red < green < blue  # the shorter the wavelength, the narrower that kernel
    empty = {"networks": [], "golden": [], "left_out": [], "notes": []}
    page = bundle_html(before, made, {**empty, "measured": {"psf": "p.safetensors"}})
    assert "<h2>Kernels</h2>" in page


def test_a_profile_without_distortion_moves_and_darkens_nothing(tmp_path: Path) -> None:
    optics = tiny_profile().model_copy(update={"distortion": None, "illumination": None})
    full = profile_stages()
    kept = [stage for stage in full if stage.type not in {"undistort", "illumination"}]
    stages = rewired(kept, full)
    plain = write_bundle(
        tmp_path / "plain.camkit", profile_manifest(optics=optics, stages=stages), {}
    )
    np.testing.assert_array_equal(light(plain, plain).original, 1)
    np.testing.assert_array_equal(outward_shift(plain, plain).now, 0)
