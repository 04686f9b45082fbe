import math
from dataclasses import replace

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.render.lens_view import lens_optics


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
