import numpy as np
import pytest

from camkit.cfa import CFA_PATTERNS, cfa_channels
from camkit.errors import ContractError
from camkit.runtime.signal.demosaic import (
    DEMOSAIC_MARGIN_PX,
    MALVAR_KERNELS,
    demosaic,
    shift_rows,
)
from tests.data_folder import data_path

METHODS = tuple(DEMOSAIC_MARGIN_PX)


def sample_cfa(planes, cfa):
    mosaic = np.empty(planes.shape[1:], dtype=np.float32)
    for dy, row in enumerate(cfa_channels(cfa)):
        for dx, color in enumerate(row):
            mosaic[dy::2, dx::2] = planes[color, dy::2, dx::2]
    return mosaic


def obvious_malvar(mosaic, cfa):
    """Pixel by pixel from the published rule, with mirrored borders."""
    padded = np.pad(mosaic.astype(np.float64), 2, mode="reflect")
    cells = cfa_channels(cfa)
    out = np.empty((3, *mosaic.shape))
    for y in range(mosaic.shape[0]):
        for x in range(mosaic.shape[1]):
            row = cells[y % 2]
            own = row[x % 2]
            window = padded[y : y + 5, x : x + 5]
            for wanted in range(3):
                if own == wanted:
                    out[wanted, y, x] = mosaic[y, x]
                    continue
                if wanted == 1:
                    name = "green"
                elif own == 1:
                    name = "along_row" if wanted in row else "along_column"
                else:
                    name = "diagonal"
                out[wanted, y, x] = (MALVAR_KERNELS[name] * window).sum()
    return out


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
def test_fast_equals_the_published_rule(cfa):
    mosaic = np.random.default_rng(3).normal(0.3, 0.4, (13, 10)).astype(np.float32)
    assert np.abs(demosaic(mosaic, cfa) - obvious_malvar(mosaic, cfa)).max() < 1e-6


def test_every_kernel_keeps_a_constant():
    for kernel in MALVAR_KERNELS.values():
        assert kernel.sum() == pytest.approx(1)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("cfa", CFA_PATTERNS)
def test_samples_are_kept_and_grey_stays_grey(cfa, method):
    rng = np.random.default_rng(5)
    planes = rng.random((3, 31, 38), dtype=np.float32)
    mosaic = sample_cfa(planes, cfa)
    result = demosaic(mosaic, cfa, method)
    for dy, row in enumerate(cfa_channels(cfa)):
        for dx, color in enumerate(row):
            at = (color, slice(dy, None, 2), slice(dx, None, 2))
            assert np.array_equal(result[at], planes[at])
    grey = np.full((31, 38), 0.25, dtype=np.float32)
    assert np.allclose(demosaic(grey, cfa, method), 0.25, atol=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_highlights_and_negatives_are_not_clipped(method):
    mosaic = np.random.default_rng(0).normal(0, 1e4, (40, 40)).astype(np.float32)
    result = demosaic(mosaic, "RGGB", method)
    assert result.min() <= mosaic.min()
    assert result.max() >= mosaic.max()
    doubled = demosaic(2 * mosaic, "RGGB", method)
    assert np.array_equal(doubled, 2 * result)


def test_one_row_down_swaps_the_rows_of_the_cell():
    assert shift_rows("RGGB", 1) == "GBRG"
    assert shift_rows("GRBG", 3) == "BGGR"
    assert shift_rows("GRBG", 4) == "GRBG"


@pytest.mark.parametrize(
    "arguments",
    [
        (np.zeros((4, 4)), "RGGB", "fast"),
        (np.zeros((3, 4, 4), dtype=np.float32), "RGGB", "fast"),
        (np.zeros((4, 4), dtype=np.float32), "RGBG", "fast"),
        (np.zeros((4, 4), dtype=np.float32), "RGGB", "best"),
        (np.zeros((0, 4), dtype=np.float32), "RGGB", "fast"),
    ],
)
def test_wrong_input_is_refused(arguments):
    with pytest.raises(ContractError):
        demosaic(*arguments)


def test_quality_beats_fast_by_two_db_on_sharp_photographs():
    import cv2

    files = sorted(data_path("valid").rglob("*.*"))
    gains = []
    for file in files:
        encoded = cv2.imread(str(file))
        if encoded is None or len(gains) == 4:
            continue
        planes = encoded[..., ::-1].transpose(2, 0, 1).astype(np.float32) / 255
        mosaic = sample_cfa(planes, "GRBG")
        errors = [np.square(demosaic(mosaic, "GRBG", m) - planes).mean() for m in METHODS]
        gains.append(10 * np.log10(errors[0] / errors[1]))
    assert np.mean(gains) > 2
