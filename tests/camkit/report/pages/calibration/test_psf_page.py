"""The page of a measured PSF."""

import numpy as np
import pytest

from camkit.calibration.measured import (
    COLOURS,
    WAVELENGTHS_UM,
    ColourFacts,
    MeasuredPsf,
    Reblurred,
    frozen,
)
from camkit.calibration.peak import Field
from camkit.report.pages.calibration.psf_page import draw_reblurred, draw_shares, psf_html

HALF = 20


def _found(target: Reblurred | None) -> MeasuredPsf:
    y, x = np.mgrid[-HALF : HALF + 1, -HALF : HALF + 1]
    kernels = np.stack([np.exp(-(y**2 + x**2) / (2 * s**2)) for s in (3.0, 4.0, 5.0)])
    kernels /= kernels.sum((-2, -1), keepdims=True)
    return MeasuredPsf(
        psf=frozen(kernels, 4.0, np.inf),
        centre_px=(30.5, 40.25),
        colours=tuple(
            ColourFacts(
                colour=colour,
                wavelength_um=wavelength_um,
                core_share=0.4,
                peak_share=0.9,
                peak_share_error=0.002,
                offset_px=(0.1, -0.2),
                reblurred=target,
            )
            for colour, wavelength_um in zip(COLOURS, WAVELENGTHS_UM, strict=True)
        ),
        fields=(Field(height_mm=0.5, peak_share=0.9, peak_share_error=0.002),),
        notes=("a note",),
    )


TARGET = Reblurred(
    distance_px=np.array([-1.0, 0.0, 1.0]),
    captured=np.array([0.0, 0.5, 1.0]),
    predicted=np.array([0.01, 0.5, 0.98]),
)


@pytest.mark.parametrize("target", [None, TARGET])
def test_a_target_adds_its_residual_to_kernels_and_shares(target: Reblurred | None) -> None:
    page = psf_html(_found(target))
    assert page.count("<img") == (2 if target is None else 3)
    assert "0.9000 +- 0.0020" in page
    assert "A note." in page
    assert ("1.29" in page) == (target is not None)


def test_the_light_within_a_radius_is_that_of_the_kernel() -> None:
    (panel,) = draw_shares(_found(None)).axes
    lines = {line.get_label(): line for line in panel.get_lines()}
    radius, share = (np.asarray(part) for part in lines["blue"].get_data())
    at = int(np.flatnonzero(radius == 6.5)[0])
    assert share[at] == pytest.approx(1 - np.exp(-(6.5**2) / 18), abs=0.01)


def test_what_is_left_is_drawn_below_in_percent() -> None:
    below = draw_reblurred(_found(TARGET)).axes[1]
    assert below.get_ylabel() == "left, %"
    assert below.get_lines()[0].get_ydata() == pytest.approx([-1, 0, 2])
