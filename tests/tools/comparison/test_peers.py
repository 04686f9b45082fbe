import numpy as np
import pytest
from skimage import restoration

from camkit.errors import ContractError
from camkit.runtime.bank.blocks import LocalPsf, to_otf
from camkit.runtime.bank.psf import FieldKernels
from camkit.runtime.bank.richardson_lucy import apply_transfer
from camkit.runtime.geometry.sensor_window import SensorWindow
from tests.psf_factory import ISO_100, gaussian_kernel, texture
from tools.comparison.peers import PEERS, LocalCapture, Peer, Setting, part_sides

SIDE = 96
GOOD: dict[str, Setting] = {
    "skimage_wiener": (1e-3,),
    "skimage_rl": (16.0,),
    "admm_tv": (1.0, 10.0),
    "cross_channel": (1.0, 2.0),
}


def local_psf(kernels: np.ndarray, width: int, height: int, origin_px: tuple[int, int]) -> LocalPsf:
    """The same kernels at both ends of the field of a 1000 x 800 px sensor."""
    return LocalPsf(
        kernels=FieldKernels(
            kernels=np.stack([kernels, kernels]), field_heights_mm=np.array([0.0, 10.0])
        ),
        window=SensorWindow(
            size_px=(width, height), origin_px=origin_px, sensor_size_px=(1000, 800), pitch_um=6.0
        ),
    )


def blurred(scene: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    """Blur a square periodic scene."""
    return apply_transfer(scene, to_otf(kernel, scene.shape[-1]))


def blurred_capture(height: int = SIDE, width: int = SIDE) -> LocalCapture:
    """The middle of a blurred texture: light crosses the borders as in a picture."""
    kernel = gaussian_kernel(1.2)
    picture = blurred(texture(2 * SIDE, 2 * SIDE), kernel)
    return LocalCapture(
        planes=np.ascontiguousarray(picture[:, 40 : 40 + height, 50 : 50 + width]),
        psf=local_psf(kernel, width, height, (452, 352)),
        noise=ISO_100,
        saturated=None,
    )


def sharp_cut(height: int = SIDE, width: int = SIDE) -> np.ndarray:
    return texture(2 * SIDE, 2 * SIDE)[:, 40 : 40 + height, 50 : 50 + width]


def error(planes: np.ndarray, sharp: np.ndarray) -> float:
    inside = np.s_[:, 12:-12, 12:-12]
    return float(np.sqrt(np.mean((planes - sharp)[inside] ** 2)))


@pytest.mark.parametrize("name", sorted(PEERS))
def test_every_peer_undoes_a_known_blur_in_place(name: str) -> None:
    capture = blurred_capture()
    restored = PEERS[name].restore(capture, GOOD[name])
    assert restored.shape == capture.planes.shape
    assert error(restored, sharp_cut()) < 0.9 * error(capture.planes, sharp_cut())


@pytest.mark.parametrize("name", sorted(PEERS))
def test_every_peer_takes_odd_sides(name: str) -> None:
    capture = blurred_capture(height=61, width=83)
    restored = PEERS[name].restore(capture, GOOD[name])
    assert error(restored, sharp_cut(61, 83)) < 0.9 * error(capture.planes, sharp_cut(61, 83))


@pytest.mark.parametrize("name", sorted(PEERS))
@pytest.mark.parametrize("corner", [(1, 1), (-1, 1), (-1, -1), (1, -1)])
def test_a_one_sided_blur_is_undone_in_every_quadrant(name: str, corner: tuple[int, int]) -> None:
    """A kernel that is mirrored or turned wrongly sharpens nothing."""
    comet = np.zeros((3, 11, 11), np.float32)
    comet[:, 5, 5], comet[:, 6:, 5] = 0.4, 0.12  # its tail points down, away from the axis
    sign_x, sign_y = corner
    tail = comet if sign_y > 0 else comet[:, ::-1]
    picture = blurred(texture(2 * SIDE, 2 * SIDE), np.ascontiguousarray(tail))
    capture = LocalCapture(
        planes=np.ascontiguousarray(picture[:, 40 : 40 + SIDE, 50 : 50 + SIDE]),
        psf=local_psf(comet, SIDE, SIDE, (452 + 2 * sign_x, 352 + 340 * sign_y)),
        noise=ISO_100,
        saturated=None,
    )
    restored = PEERS[name].restore(capture, GOOD[name])
    assert error(restored, sharp_cut()) < 0.6 * error(capture.planes, sharp_cut())


def test_richardson_lucy_is_that_of_scikit_image() -> None:
    capture = blurred_capture()
    restored = PEERS["skimage_rl"].restore(capture, (6.0,))
    kernel = capture.psf.kernels.kernels[0]
    padded = np.pad(capture.planes, ((0, 0), (48, 48), (48, 48)), mode="reflect")
    for plane, spread, got in zip(padded, kernel, restored, strict=True):
        expected = restoration.richardson_lucy(np.maximum(plane, 0), spread, num_iter=6, clip=False)
        np.testing.assert_allclose(got, expected[48:-48, 48:-48], rtol=2e-4, atol=2e-5)


def test_wiener_is_that_of_scikit_image() -> None:
    capture = blurred_capture()
    restored = PEERS["skimage_wiener"].restore(capture, (0.1,))
    padded = np.pad(capture.planes, ((0, 0), (48, 48), (48, 48)), mode="reflect")
    for plane, spread, got in zip(padded, capture.psf.kernels.kernels[0], restored, strict=True):
        expected = restoration.wiener(plane, spread, 0.1, clip=False)
        np.testing.assert_allclose(got, expected[48:-48, 48:-48], atol=2e-4)


@pytest.mark.parametrize("name", sorted(PEERS))
def test_highlights_are_not_clipped_at_one(name: str) -> None:
    dim = blurred_capture()
    bright = LocalCapture(planes=dim.planes * 5, psf=dim.psf, noise=dim.noise, saturated=None)
    assert PEERS[name].restore(bright, GOOD[name]).max() > 2


def test_candidates_increase_and_all_settings_are_tried() -> None:
    for peer in PEERS.values():
        for values in peer.candidates:
            assert list(values) == sorted(set(values))
            assert len(values) >= 3
        assert len(set(peer.settings)) == np.prod([len(values) for values in peer.candidates])


def test_parts_hold_their_kernels_and_overlap_by_as_much() -> None:
    for kernel_px in (1, 111, 129, 131, 257, 259):
        part_px, overlap_px = part_sides(kernel_px)
        assert kernel_px - 1 <= overlap_px <= part_px // 3
        assert part_px == 3 * overlap_px
    assert part_sides(129) == (384, 128)


def test_a_setting_of_the_wrong_length_is_refused() -> None:
    with pytest.raises(ContractError, match="weight, iterations"):
        PEERS["admm_tv"].restore(blurred_capture(), (1.0,))


def test_a_peer_needs_candidates_for_every_parameter() -> None:
    maker = PEERS["admm_tv"].make_filter
    with pytest.raises(ContractError, match="candidates"):
        Peer(make_filter=maker, parameters=("weight", "iterations"), candidates=((1.0,),))


def test_planes_of_another_size_than_their_place_are_refused() -> None:
    capture = blurred_capture()
    with pytest.raises(ContractError, match="planes must be"):
        LocalCapture(
            planes=capture.planes[:, 1:], psf=capture.psf, noise=capture.noise, saturated=None
        )
