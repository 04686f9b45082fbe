import math
from dataclasses import replace

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.render.lens_view import free_optics, lens_optics
from camkit.models_def.optics.search.variables import FreeLens, Variable

EXACT = 1e-12


def test_a_lens_of_a_search_has_the_optics_of_its_prescription(near_duet: Lens) -> None:
    free = FreeLens(
        lens=near_duet,
        variables=(Variable(kind="conic", surface=4, low=-2.0, high=0.0),),
    )
    scaled = torch.tensor([0.3], dtype=torch.float64, requires_grad=True)
    optics = free_optics(free, scaled, 1000.0)
    wanted = lens_optics(replace(free.lens_at(scaled.detach()), object_distance_mm=1000.0))
    waves = torch.tensor([[0.46, 0.54], [0.6, 0.65]], dtype=torch.float64)
    made, known = optics.stopped(waves), wanted.stopped(waves)
    assert optics.stop_radius_mm == pytest.approx(wanted.stop_radius_mm)
    for name in ("curvature_per_mm", "conic", "thickness_mm", "index"):
        assert getattr(made, name).shape == getattr(known, name).shape
        assert float((getattr(made, name) - getattr(known, name)).detach().abs().max()) < EXACT
    made.conic.sum().backward()
    assert scaled.grad is not None
    assert float(scaled.grad[0]) == pytest.approx(2.0)


def test_the_stop_limits_rays_whatever_the_file_says_of_its_rim(near_duet: Lens) -> None:
    wide = replace(
        near_duet,
        surfaces=(
            replace(near_duet.surfaces[0], semi_diameter_mm=math.inf),
            *near_duet.surfaces[1:],
        ),
    )
    made = lens_optics(wide).stopped(torch.tensor(0.54))
    assert float(made.semi_diameter_mm[0]) == pytest.approx(6.25)


def test_a_texture_at_infinity_is_refused(near_duet: Lens) -> None:
    with pytest.raises(ContractError, match="finite distance"):
        lens_optics(replace(near_duet, object_distance_mm=math.inf))
