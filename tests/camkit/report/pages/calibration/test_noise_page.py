"""The page of a sensor's noise."""

from camkit.calibration.noise.rounding import Spread
from camkit.calibration.noise.sensor_noise import IsoFacts, NoiseFacts
from camkit.calibration.noise.transfer import Point, fit_transfer
from camkit.report.pages.calibration.noise_page import draw_transfer, noise_html

DARK = Point(signal=0.0, variance=0.3, samples=10_000)
POINTS = [Point(signal=s, variance=0.3 + s / 4, samples=10_000) for s in (100.0, 400.0, 2000.0)]


def _facts(*, resolved: bool, linearity: float | None) -> IsoFacts:
    line = fit_transfer(POINTS, DARK)
    return IsoFacts(
        iso=100.0,
        transfers={"R": line, "G1": line, "G2": line, "B": line},
        gain_e_per_dn=4.0,
        gain_error=0.001,
        read=Spread(value=0.4, resolved=resolved),
        black_level=256.0,
        white_level=4095.0,
        prnu=0.01,
        dsnu_dn=0.2,
        linearity=linearity,
        pairs=3,
        defects=0.0,
    )


def test_every_iso_has_its_picture_and_a_bound_is_said_as_one() -> None:
    isos = (_facts(resolved=False, linearity=None), _facts(resolved=True, linearity=0.01))
    page = noise_html(NoiseFacts(camera="<Kamera>", isos=isos, notes=("a note",)))
    assert page.count("<img") == 2
    assert "below 1.6" in page
    assert "&lt;Kamera&gt;" in page
    assert "A note." in page


def test_residuals_of_an_exact_line_lie_on_zero() -> None:
    _, rest = draw_transfer(_facts(resolved=True, linearity=None)).axes
    low, high = rest.get_ylim()
    assert low < 0 < high
    points = [line.get_ydata() for line in rest.get_lines()]
    assert max(abs(float(y)) for ys in points for y in ys) < 3  # bars are 2 x 1.4 %
