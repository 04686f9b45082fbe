"""The array of a bundle: what it takes, its network's planes, photons in and out."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.bundle.reader import open_bundle
from camkit.errors import BundleError, ContractError
from camkit.runtime.kinds.spad.finer.camera import FineCamera, network_planes, white_of
from camkit.runtime.kinds.spad.finer.covariance import PictureCovariance
from camkit.runtime.kinds.spad.finer.linear import linear_estimate
from camkit.runtime.kinds.spad.finer.pictures import finer_frames
from camkit.runtime.kinds.spad.finer.sampling import point_kernel
from tests.bundle_factory import write_tiny_bundle
from tests.spad_bundle import HEIGHT, WIDTH


def _counts(photons: float = 200.0, frames: int = 2) -> np.ndarray:
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    mean = photons * (0.5 + 0.2 * np.sin(x / 3) + 0.2 * np.cos(y / 4))
    rng = np.random.default_rng(3)
    return rng.poisson(np.broadcast_to(mean, (frames, *mean.shape))).astype(np.float32)


def test_a_camera_of_photographs_is_refused(tmp_path) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(BundleError, match=r"has no stage super_resolve.*bundle=.none."):
        FineCamera.of(open_bundle(write_tiny_bundle(tmp_path)))


def test_sizes_that_are_not_held_are_refused(camera: FineCamera) -> None:
    assert camera.size(None) == "S"
    with pytest.raises(ContractError, match=r"holds size.s. S; asked for XL"):
        camera.size("XL")


def test_noise_is_told_as_three_deviations() -> None:
    planes = network_planes(np.array([[3.0, 0.0]], np.float32), 10.0, 5.0)
    np.testing.assert_allclose(planes[0], [[0.3, 0.0]])
    np.testing.assert_allclose(planes[1], 3 * np.sqrt([[9.0, 6.0]]) / 10, rtol=1e-6)


def test_the_network_gives_photons_whatever_is_white(camera: FineCamera) -> None:
    """A new network is bicubic interpolation, which knows no scale."""
    frames = _counts()
    one = camera.by_network(frames, "S", white=100.0)
    other = camera.by_network(frames, "S", white=350.0)
    assert one.shape == (2, 4 * HEIGHT, 4 * WIDTH)
    np.testing.assert_allclose(one, other, atol=0.05)
    # at sub-pixel `phase` a sample is its own
    np.testing.assert_allclose(one[:, 2::4, 2::4], frames, atol=0.05)


def test_frames_without_photons_stay_dark(camera: FineCamera) -> None:
    frames = _counts()
    frames[1] = 0
    for size in ("S", None):
        fine = finer_frames(camera, frames, 0.0, size)
        assert (fine[1] == 0).all()
        assert fine[0].mean() == pytest.approx(frames[0].mean(), rel=0.03)


def test_the_linear_estimate_is_that_of_the_stage_behind_any_kernel(camera: FineCamera) -> None:
    stage = camera.stage.model_copy(update={"contrast": 0.3, "reach": 20.0, "exponent": 1.1})
    other, point = replace(camera, stage=stage), point_kernel(camera.kernel.shape[0])
    covariance = PictureCovariance(contrast=0.3, reach=20.0, exponent=1.1)
    for kernel, found in ((camera.kernel, other.linear(40.0)), (point, other.linear(40.0, point))):
        wanted = linear_estimate(kernel, camera.grid, covariance, 40.0)
        np.testing.assert_array_equal(found.weights, wanted.weights)


def test_white_is_never_chance_alone() -> None:
    assert white_of(np.zeros((4, 4), np.float32)) == 4.0
    assert white_of(np.full((4, 4), 90.0, np.float32)) == 90.0
