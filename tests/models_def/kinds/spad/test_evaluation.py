"""The protocol of tables 4.1 and 4.2; its bicubic figures on the real sets."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from skimage.metrics import structural_similarity

from camkit.arrays import FloatArray
from camkit.models_def.kinds.spad.counting import Exposure
from camkit.models_def.kinds.spad.evaluation import (
    MOST_DB,
    SETS,
    bicubic,
    evaluate,
    read_luminance,
    read_set,
)
from camkit.models_def.kinds.spad.sampling import make_sampling
from tests.data_folder import data_path

NO_NOISE = Exposure(photons=float("inf"))


def _pictures(count: int) -> tuple[FloatArray, ...]:
    rng = np.random.default_rng(3)
    return tuple(
        cv2.GaussianBlur(rng.random((64, 96), np.float32), (0, 0), 3) for _ in range(count)
    )


@pytest.mark.parametrize(
    ("name", "psnr_db"), [("set5", 26.32), ("set14", 23.28), ("bsd100_half_a", 23.34)]
)
def test_bicubic_at_the_true_phase_has_the_figures_of_the_protocol(
    name: str, psnr_db: float
) -> None:
    """What the method without training gives on the sets of the thesis, noise-free."""
    sampling = make_sampling("low_fill")
    score = evaluate(read_set(data_path(f"test/{name}")), sampling, NO_NOISE, bicubic(sampling))
    assert score.psnr_db == pytest.approx(psnr_db, abs=0.006)
    assert score.pictures == {"set5": 5, "set14": 14, "bsd100_half_a": 50}[name]


def test_a_wrong_phase_costs_what_it_must() -> None:
    """Half a sub-pixel little, two sub-pixels much."""
    pictures = _pictures(2)
    sampling = make_sampling("low_fill", phase=2)
    scores = [
        evaluate(pictures, sampling, NO_NOISE, bicubic(make_sampling("low_fill", phase=p))).psnr_db
        for p in (2, 1, 0)
    ]
    assert scores[0] > scores[1] + 0.5 > scores[2] + 2


def test_the_scores_are_the_mean_of_pictures_by_other_programs() -> None:
    pictures = _pictures(3)
    sampling = make_sampling("gaussian")
    score = evaluate(pictures, sampling, NO_NOISE, bicubic(sampling))
    psnrs, ssims = [], []
    for picture in pictures:
        seen = sampling.see(torch.from_numpy(picture)[None, None])
        found = bicubic(sampling)(seen)[0, 0].clamp(0, 1).numpy()
        psnrs.append(cv2.PSNR(picture, found, R=1.0))
        _, full = structural_similarity(
            picture,
            found,
            data_range=1.0,
            gaussian_weights=True,
            sigma=1.5,
            use_sample_covariance=False,
            full=True,
        )
        ssims.append(full[5:-5, 5:-5].mean())
    assert score.psnr_db == pytest.approx(np.mean(psnrs), abs=1e-3)
    assert score.ssim == pytest.approx(np.mean(ssims), abs=1e-4)


def test_noise_is_the_same_every_time_and_of_its_level() -> None:
    pictures = tuple(np.full((64, 64), 0.5, np.float32) for _ in range(4))
    sampling = make_sampling("low_fill")

    def repeated(planes: torch.Tensor) -> torch.Tensor:
        return planes[:, :1].repeat_interleave(4, -1).repeat_interleave(4, -2)

    first, again = (
        evaluate(pictures, sampling, Exposure(photons=1000.0), repeated) for _ in range(2)
    )
    assert first == again
    # variance of 500 counts over 1000^2
    assert first.psnr_db == pytest.approx(-10 * np.log10(500 / 1000**2), abs=0.3)


def test_equal_pictures_have_the_most_and_what_leaves_the_range_is_cut() -> None:
    picture = np.ones((16, 16), np.float32)
    sampling = make_sampling("low_fill")
    score = evaluate([picture], sampling, NO_NOISE, lambda p: 3 + p.new_zeros(1, 1, 16, 16))
    assert score.psnr_db == MOST_DB
    assert score.ssim == pytest.approx(1)


def test_pictures_are_read_as_luminance_of_whole_pixels(tmp_path: Path) -> None:
    coded = np.zeros((10, 15, 3), np.uint8)
    coded[..., 2] = 255  # red, as OpenCV writes
    cv2.imwrite(str(tmp_path / "red.png"), coded)
    found = read_luminance(tmp_path / "red.png")
    assert found.shape == (8, 12)
    np.testing.assert_allclose(found, 0.299, atol=1e-6)
    assert len(read_set(tmp_path)) == 1
    assert len(SETS) == 3
