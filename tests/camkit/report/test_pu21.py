"""PU21: the values that the authors' package gives, and its PSNR and SSIM where it is installed."""

import numpy as np
import pytest

from camkit.report import jod
from camkit.report.hdr_score import psnr_db
from camkit.report.pu21 import LEAST_NITS, MOST_NITS, pu21, pu21_mean_square, pu21_ssim
from tests.hdr_pictures import hdr_pair

TOLERANCE = 1e-3
OF_CVVDP = {
    0.005: 0.0,
    0.1: 5.717073839669447,
    1: 36.5439111394192,
    10: 123.64748355384738,
    39.0625: 197.96961669342565,
    100: 256.3838973127039,
    1000: 420.0969213492443,
    4000: 527.4939005367281,
    10_000: 595.393920020095,
}
"""Luminance in cd/m^2 -> code, computed by cvvdp 0.5.7 in float64."""
SCORES_OF_CVVDP = {39.0625: (29.24746, 0.88736), 100.0: (29.01802, 0.88232)}
"""cd/m^2 of white -> PU21-PSNR-Y in dB and SSIM of `hdr_pair`, computed by cvvdp 0.5.7."""


def test_codes_are_those_of_the_authors() -> None:
    codes = pu21(list(OF_CVVDP))
    np.testing.assert_allclose(codes, list(OF_CVVDP.values()), atol=TOLERANCE)


def test_luminance_outside_the_range_counts_as_its_end() -> None:
    assert pu21(0.0) == pu21(-1.0) == pu21(LEAST_NITS)
    assert pu21(1e9) == pu21(MOST_NITS)
    assert (np.diff(pu21(np.geomspace(LEAST_NITS, MOST_NITS, 500))) > 0).all()


@pytest.mark.parametrize("nits_per_unit", SCORES_OF_CVVDP)
def test_scores_are_those_of_the_authors(nits_per_unit: float) -> None:
    psnr, ssim = SCORES_OF_CVVDP[nits_per_unit]
    pair = hdr_pair()
    assert psnr_db(pu21_mean_square(*pair, nits_per_unit)) == pytest.approx(psnr, abs=TOLERANCE)
    assert pu21_ssim(*pair, nits_per_unit) == pytest.approx(ssim, abs=TOLERANCE)


def test_codes_and_scores_agree_with_cvvdp_where_it_is_installed() -> None:
    if (reason := jod.obstacle()) is not None:
        pytest.skip(reason)
    import pycvvdp  # type: ignore[import-not-found,unused-ignore]
    import torch
    from pycvvdp.ssim_metric import (  # type: ignore[import-not-found,unused-ignore]
        ssim_metric,
    )
    from pycvvdp.utils import PU  # type: ignore[import-not-found,unused-ignore]
    from pycvvdp.video_source import (  # type: ignore[import-not-found,unused-ignore]
        video_source_array,
    )

    nits = np.geomspace(1e-3, 1e5, 4001)
    theirs = PU().encode(torch.from_numpy(nits)).numpy()
    np.testing.assert_allclose(pu21(nits), theirs, atol=TOLERANCE)
    result, truth = hdr_pair()
    display = pycvvdp.vvdp_display_photo_eotf(
        MOST_NITS, contrast=MOST_NITS / LEAST_NITS, source_colorspace="BT.709-linear"
    )
    for white in SCORES_OF_CVVDP:
        shown = [torch.from_numpy(p * np.float32(white)) for p in (result, truth)]
        found = []
        for metric in (pycvvdp.pu_psnr_y, ssim_metric):
            made = metric(display_photometry=display, device=torch.device("cpu"))
            source = video_source_array(*shown, 0, dim_order="CHW", display_photometry=display)
            found.append(float(made.predict_video_source(source)[0]))
        own = psnr_db(pu21_mean_square(result, truth, white)), pu21_ssim(result, truth, white)
        assert own == pytest.approx(found, abs=TOLERANCE)
