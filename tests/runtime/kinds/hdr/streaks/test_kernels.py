"""A kernel is core and veil, nothing else; lengths stay lengths at either pitch."""

import numpy as np
import pytest

from camkit.cfa import CfaPattern
from camkit.errors import ContractError
from camkit.runtime.kinds.hdr.streaks.cells import cell_kernel, coarser_kernel, sample_sites
from camkit.runtime.kinds.hdr.streaks.kernels import CORE_CELLS, streak_kernels
from tests.hdr_bundle import CORE_SHARE, HAZE_SHARE, STREAK_SHARE
from tests.streak_factory import star, star_kernels

CORE_PX = 4.0


@pytest.mark.parametrize("cfa", ["RGGB", "GBRG", None])
def test_core_and_veil_are_the_kernel(cfa: CfaPattern | None) -> None:
    kernels, sites = star_kernels(cfa), sample_sites(cfa)
    for colour in range(3):
        fine = cell_kernel(star()[colour], sites[colour])
        for cells, whole in ((kernels.fine, fine), (kernels.coarse, coarser_kernel(fine))):
            np.testing.assert_array_equal(cells.whole[colour], whole)
            veil = cells.veil[colour]
            place = (np.arange(len(whole)) - len(whole) // 2) * cells.pitch_px
            within = np.hypot(place[:, None], place[None, :]) <= CORE_PX
            np.testing.assert_array_equal(veil[~within], whole[~within])
            assert (veil[within] == 0).all()
            core = whole[within].sum(dtype=np.float64)
            assert cells.core[colour] == pytest.approx(core, abs=1e-7)
    assert {pitch * cells for pitch, cells in CORE_CELLS.items()} == {CORE_PX}


def test_the_shares_of_core_and_streaks_are_those_that_the_optics_have() -> None:
    """Arms begin beyond 8 px: within 4 px is the core, which cells of 4 px blur beyond that."""
    kernels = star_kernels()
    for cells, blur in ((kernels.fine, 2e-4), (kernels.coarse, 0.015)):
        for colour in range(3):
            assert CORE_SHARE - blur <= cells.core[colour] <= CORE_SHARE + 2e-4
            beside = cells.veil[colour].sum()
            assert STREAK_SHARE + HAZE_SHARE - 2e-4 <= beside <= STREAK_SHARE + HAZE_SHARE + blur


@pytest.mark.parametrize("shape", [(3, 8, 8), (1, 9, 9), (9, 9)])
def test_what_are_no_three_kernels_with_a_middle_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(ContractError, match=r"must be \(3, n, n\), n odd"):
        streak_kernels(np.ones(shape, np.float32), sample_sites(None), 10)
