"""A stream that broke is told from patterns whose rows shift: it stays shifted to its end."""

import cv2
import numpy as np
import pytest

from camkit.runtime.files.doubts import find_doubts
from camkit.runtime.files.raw_checks import Levels

BLACK, WHITE = 256, 4095
COLOURS = np.array([[0.5, 1.0], [1.0, 0.6]])
LEVELS = Levels(black=np.full((2, 2), BLACK, dtype=np.float32), white=WHITE)
SQUARES_PX = (5, 8, 13, 20, 37, 64)
PLACES = np.mgrid[:300, :400].astype(np.float64)


def doubts(light, *, colours=True, seed=0):
    """Return what is doubted of the rows of a scene in the numbers of a camera."""
    height, width = (side // 2 * 2 for side in light.shape)
    grey = light[:height, :width] * np.tile(
        COLOURS if colours else np.ones((2, 2)), (height // 2, width // 2)
    )
    noise = np.random.default_rng(seed).normal(0, 4, grey.shape)
    mosaic = np.clip(BLACK + (WHITE - BLACK) * grey + noise, 0, WHITE).astype(np.uint16)
    return rows_of(find_doubts(mosaic, LEVELS, "RGGB"))


def rows_of(found):
    return [doubt for doubt in found if "rows" in doubt]


def turned(angle):
    y, x = PLACES
    return x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)


def squares(size, angle=0.0):
    x, y = turned(angle)
    return (x // size + y // size) % 2


def bricks(size, course):
    y, x = PLACES
    row = y // size
    shifted = x + row % course * 3 * size / course
    joint = max(1, size // 6)
    tone = np.random.default_rng(size).uniform(0.5, 1, (99, 99))
    tones = tone[(row % 99).astype(int), (shifted // (3 * size) % 99).astype(int)]
    return np.where((y % size < joint) | (shifted % (3 * size) < joint), 0, tones)


def star(spokes):
    y, x = PLACES
    return np.sin(spokes * np.arctan2(y - 149.7, x - 199.8)) > 0


def framed(inner):
    out = np.ones_like(inner)
    out[60:-60, 60:-60] = inner[60:-60, 60:-60]
    return out


def dots(size):
    y, x = PLACES
    across = (x + y // size % 2 * size / 2) % size - size / 2
    return across**2 + (y % size - size / 2) ** 2 < (size / 3) ** 2


PATTERNS = {
    **{f"checkerboard {n}": squares(n) for n in SQUARES_PX},
    **{f"checkerboard in a frame {n}": framed(squares(n)) for n in SQUARES_PX},
    **{f"soft checkerboard {n}": cv2.GaussianBlur(squares(n), (0, 0), 1.5) for n in SQUARES_PX},
    **{f"checkerboard {n} at {a}": squares(n, a) for n in SQUARES_PX for a in (0.05, 0.2, 0.7)},
    **{f"stripes {n} at {a}": turned(a)[0] // n % 2 for n in SQUARES_PX for a in (0.05, 0.7)},
    **{f"bricks {n} of {c}": bricks(n, c) for n in SQUARES_PX for c in (2, 3)},
    **{f"star of {n}": star(n) for n in (8, 16, 36, 72)},
    **{f"star in a frame {n}": framed(star(n)) for n in (8, 36)},
    **{f"dots {n}": dots(n) for n in SQUARES_PX},
    **{f"waves {n}": 0.5 + 0.5 * np.sin(PLACES[0] / n) * np.sin(PLACES[1] / n) for n in SQUARES_PX},
    "two rows of squares": (PLACES[1] // 40 + (PLACES[0] > 150)) % 2,
    "vernier": (PLACES[1] + (PLACES[0] > 150) * 3) % 24 < 2,
    "shelves": np.random.default_rng(6).uniform(0, 1, (8, 60))[
        np.minimum(PLACES[0] // 38, 7).astype(int), (PLACES[1] * 60 // 400).astype(int)
    ],
    "slanted edge": PLACES[1] > 200 + 0.1 * (PLACES[0] - 150),
    "zone plate": 0.5 + 0.5 * np.cos(((PLACES - 150) ** 2).sum(axis=0) * np.pi / 2000),
}


@pytest.mark.parametrize("name", PATTERNS)
@pytest.mark.parametrize("colours", [True, False])
def test_sharp_patterns_are_no_shifted_rows(name, colours):
    light = 0.1 + 0.7 * np.asarray(PATTERNS[name], dtype=np.float64)
    assert doubts(light, colours=colours) == []
    assert doubts(np.kron(light, np.ones((2, 2))), colours=colours) == []


def photograph(seed, height=300, width=400):
    """Return a scene of shapes of every size whose left and right differ."""
    rng = np.random.default_rng(seed)
    out = sum(
        cv2.GaussianBlur(rng.standard_normal((height, width)), (0, 0), size) * size
        for size in (3, 8, 24)
    )
    out = (out - out.min()) / np.ptp(out)
    return 0.05 + 0.7 * out**1.5


def mosaic_of(light, seed=0):
    grey = light * np.tile(COLOURS, (light.shape[0] // 2, light.shape[1] // 2))
    noise = np.random.default_rng(seed).normal(0, 4, grey.shape)
    return np.clip(BLACK + (WHITE - BLACK) * grey + noise, 0, WHITE).astype(np.uint16)


@pytest.mark.parametrize("lost", [60, 150, 251, 330])
def test_most_streams_that_lost_samples_are_named_with_their_place(lost):
    named = []
    for seed in range(6):
        mosaic = mosaic_of(photograph(seed))
        assert rows_of(find_doubts(mosaic, LEVELS, "RGGB")) == []
        at, flat = 140 * 400 + 37 * seed, mosaic.ravel()
        cut = np.concatenate([flat[:at], flat[at + lost :], flat[:lost]])
        found = rows_of(find_doubts(cut.reshape(mosaic.shape), LEVELS, "RGGB"))
        named += [doubt for doubt in found if "rows are shifted" in doubt]
    assert len(named) >= 4
    assert all(any(f"from {n}%" in doubt for n in range(30, 65)) for doubt in named)


def test_bands_of_zeros_that_begin_within_a_row_are_lost_data():
    light = mosaic_of(photograph(1))
    black = Levels(black=np.zeros((2, 2), dtype=np.float32), white=WHITE)
    for first, last in ((100 * 400 + 111, 140 * 400 + 70), (50 * 400 + 8, 53 * 400)):
        lost = light.ravel().copy()
        lost[first:last] = 0
        found = find_doubts(lost.reshape(light.shape), black, "RGGB")
        assert any("are 0: the pixel data are damaged" in doubt for doubt in found)
    bars = light.copy()
    bars[:40], bars[-40:] = 0, 0
    assert not any("are 0" in doubt for doubt in find_doubts(bars, black, "RGGB"))
