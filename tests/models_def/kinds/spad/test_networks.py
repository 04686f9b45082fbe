"""Networks by name, and the camera whose plate is trained with them."""

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.kinds.spad.networks import NETWORK_NAMES, JointCamera, build_spad_network
from camkit.models_def.kinds.spad.sampling import make_sampling
from camkit.models_def.networks.sub_pixel import SubPixel

SMALL = {
    "sub_pixel_s": {"width": 16, "blocks": 1},
    "sub_pixel_m": {"width": 16, "blocks": 1},
    "d_dbpn": {"stages": 2, "first_width": 8, "width": 4},
    "srcnn": {"kernels_px": [3, 1, 3]},
    "vdsr": {"layers": 3, "width": 8},
}


@pytest.mark.parametrize("name", NETWORK_NAMES)
def test_every_network_makes_a_picture_four_times_as_fine(name: str) -> None:
    config = SMALL[name.removeprefix("joint_")]
    if name.startswith("joint_"):
        found = build_spad_network(name, **config)(torch.rand(1, 2, 24, 32))
    else:
        found = build_spad_network(name, in_channels=2, **config)(torch.rand(1, 2, 6, 8))
    assert found.shape == (1, 1, 24, 32)


def test_a_joint_camera_sees_as_the_array_does_and_tells_its_noise() -> None:
    network = build_spad_network("joint_sub_pixel_s", width=16, blocks=1, sigma=1.4, phase=1)
    assert isinstance(network, JointCamera)
    sharp = torch.rand(1, 1, 16, 16)
    sampling = make_sampling("gaussian", sigma=1.4, phase=1)
    light = network.see(sharp)
    assert torch.allclose(light, sampling.see(sharp), atol=1e-6)
    photons = 40.0
    told = torch.cat([light, 3 * torch.sqrt((light + 1 / photons) / photons)], 1)
    torch.nn.init.normal_(network.network.tail.weight)  # type: ignore[union-attr, arg-type]
    planes = torch.cat([sharp, torch.full_like(sharp, photons**-0.5)], 1)
    assert torch.allclose(network(planes), network.network(told), atol=1e-4)


def test_the_plate_is_a_weight_of_a_joint_camera_alone() -> None:
    joint = build_spad_network("joint_sub_pixel_s")
    assert "plate.logits" in joint.state_dict()
    assert isinstance(build_spad_network("sub_pixel_s"), SubPixel)
    assert "plate.logits" not in build_spad_network("sub_pixel_s").state_dict()


def test_what_is_unknown_is_refused_by_name() -> None:
    with pytest.raises(ContractError, match=r"one of sub_pixel_s.*; got 'lean_s'"):
        build_spad_network("lean_s")
    with pytest.raises(ContractError, match="sub_pixel_m does not take this configuration"):
        build_spad_network("sub_pixel_m", colour=1)
    with pytest.raises(ContractError, match="does not take this configuration"):
        build_spad_network("sub_pixel_m", sigma=1.0)
