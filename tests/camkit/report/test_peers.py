import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.report.peers import PEERS, LocalCapture, trim_kernels
from tests.psf_factory import ISO_100, gaussian_kernel, local_psf, texture

SIDE = 96
GOOD = {"skimage_wiener": 1e-3, "skimage_rl": 48.0, "admm_tv": 1.0}


def blurred_capture(sigma_px: float = 1.2, height: int = SIDE, width: int = SIDE) -> LocalCapture:
    """The middle of a blurred texture: light crosses the borders as in a picture."""
    kernel = trim_kernels(gaussian_kernel(sigma_px))
    scene = texture(2 * SIDE, 2 * SIDE)
    spread = np.zeros((3, 2 * SIDE, 2 * SIDE), np.float32)
    side = kernel.shape[-1]
    spread[:, :side, :side] = kernel
    otf = np.fft.rfft2(np.roll(spread, (-(side // 2),) * 2, axis=(1, 2)))
    blurred = np.fft.irfft2(np.fft.rfft2(scene) * otf, s=scene.shape[1:]).astype(np.float32)
    cut = np.s_[:, 40 : 40 + height, 50 : 50 + width]
    return LocalCapture(
        planes=np.ascontiguousarray(blurred[cut]),
        kernels=kernel,
        noise=ISO_100,
        saturated=None,
        window=local_psf(kernel, np.zeros(1), (width, height)).window,
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
    assert error(restored, sharp_cut()) < 0.8 * error(capture.planes, sharp_cut())


@pytest.mark.parametrize("name", sorted(PEERS))
def test_every_peer_takes_odd_sides(name: str) -> None:
    capture = blurred_capture(height=61, width=83)
    restored = PEERS[name].restore(capture, GOOD[name])
    assert error(restored, sharp_cut(61, 83)) < 0.8 * error(capture.planes, sharp_cut(61, 83))


@pytest.mark.parametrize("name", sorted(PEERS))
def test_highlights_are_not_clipped_at_one(name: str) -> None:
    dim = blurred_capture()
    bright = LocalCapture(
        planes=dim.planes * 5,
        kernels=dim.kernels,
        noise=dim.noise,
        saturated=None,
        window=dim.window,
    )
    assert PEERS[name].restore(bright, GOOD[name]).max() > 2


def test_candidates_increase_and_hold_a_choice() -> None:
    for peer in PEERS.values():
        assert list(peer.candidates) == sorted(set(peer.candidates))
        assert len(peer.candidates) >= 5


def test_trimmed_kernels_keep_their_light_and_their_middle() -> None:
    kernel = gaussian_kernel(1.0, radius_px=12)
    trimmed = trim_kernels(kernel, 0.99)
    side = trimmed.shape[-1]
    assert side < kernel.shape[-1]
    assert side % 2 == 1
    np.testing.assert_allclose(trimmed.sum(axis=(1, 2)), 1, rtol=1e-6)
    assert np.unravel_index(trimmed[0].argmax(), (side, side)) == (side // 2, side // 2)
    cut = 12 - side // 2
    inner = kernel[:, cut : cut + side, cut : cut + side]
    assert inner.sum(axis=(1, 2)).min() >= 0.99


def test_a_kernel_without_its_light_is_refused() -> None:
    with pytest.raises(ContractError, match="sum to 1"):
        trim_kernels(0.5 * gaussian_kernel(1.0))


def test_even_kernels_are_refused() -> None:
    capture = blurred_capture()
    with pytest.raises(ContractError, match="odd"):
        LocalCapture(
            planes=capture.planes,
            kernels=np.ones((3, 4, 4), np.float32) / 16,
            noise=capture.noise,
            saturated=None,
            window=capture.window,
        )
