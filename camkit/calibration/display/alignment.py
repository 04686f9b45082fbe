"""A shown picture laid over a capture by the picture itself.

    marks -> homography, a pixel or two off -> blur of the capture -> Gauss-Newton, from coarse on

What is fitted is light: the capture on its own lattice, undistorted by place and never resampled,
against the shown picture, blurred like it, in the mixture of its colours that the camera sees, with
a smooth gain and smooth stray light. Positions are scaled to about -1..1, or the normal equations
lose their digits.

References: Lucas and Kanade 1981; Baker and Matthews 2004 (Gauss-Newton, forwards additive).
"""

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.caller import option_text
from camkit.errors import DecodeError

FloatGrid = NDArray[np.float64]

BLURS: Final = (0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0)
"""Of the capture, in samples of its lattice."""
ROUNDS: Final = ((6.0, 4), (2.0, 2), (0.0, 1))
"""By how many samples both are blurred beside, and which samples are looked at, every n-th."""
MIXED_SAMPLES: Final = 20_000
"""Of which colours and gain are fitted."""
LEAST_CORRELATION: Final = 0.7
MOST_MOVED: Final = 0.02
"""Of the picture's diagonal, by which the marks may be wrong."""
LEAST_SAMPLES: Final = 2000
_STEPS: Final = 15
_CONVERGED: Final = 2e-3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Patch:
    """The part of a capture that shows a picture.

    Attributes:
        grey: (h, w) light.
        usable: (h, w) where it may be looked at.
        ideal_px: (h, w, 2) places without distortion.
    """

    grey: FloatArray
    usable: NDArray[np.bool_]
    ideal_px: FloatGrid

    def thinned(self, blur: float, every: int) -> "Patch":
        """Return every n-th sample of the patch, blurred."""
        grey = cv2.GaussianBlur(self.grey, (0, 0), blur) if blur else self.grey
        lattice = np.s_[::every, ::every]
        return Patch(
            grey=np.ascontiguousarray(grey[lattice], dtype=np.float32),
            usable=self.usable[lattice],
            ideal_px=self.ideal_px[lattice],
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Aligned:
    """A picture laid over a capture.

    Attributes:
        to_picture: (3, 3) places without distortion -> px of the shown picture.
        correlation: Of capture and model.
        model: (h, w) the picture as the camera would see it.
        inside: (h, w) where it lies on the patch, its border left out.
    """

    to_picture: FloatGrid
    correlation: float
    model: FloatGrid
    inside: NDArray[np.bool_]


def align(patch: Patch, picture: FloatArray, start: FloatGrid) -> Aligned:
    """Align a picture with a capture.

    Args:
        patch: The part of the capture.
        picture: (3, h, w) light of the picture.
        start: (3, 3) first homography, places without distortion -> px of the picture.

    Raises:
        DecodeError: If the two do not look alike, or too little is seen.
    """
    blur, matrix, step = 0.0, start, _samples_per_px(patch, start)
    for extra, every in ROUNDS:
        thin = patch.thinned(extra, every)
        if every != ROUNDS[1][1]:
            blur = _blur_of(patch.thinned(0.0, ROUNDS[1][1]), picture, matrix, step)
        soft = _softened(picture, float(np.hypot(blur, extra)) / step)
        margin = 2.0 * float(np.hypot(blur, extra)) / step + 2
        matrix = _refined(thin, soft, matrix, margin)
    model, inside, correlation = _compared(patch, soft, matrix, margin)
    if _movement(start, matrix, picture.shape) > MOST_MOVED:
        correlation = 0.0
    if not correlation >= LEAST_CORRELATION:
        raise DecodeError(
            f"capture and picture correlate by {correlation:.2f} where the marks put them, "
            f"{LEAST_CORRELATION} is needed: are captures and {option_text('targets')} of one set?"
        )
    return Aligned(to_picture=matrix, correlation=correlation, model=model, inside=inside)


def map_places(matrix: FloatGrid, places: FloatGrid) -> FloatGrid:
    """Apply a homography to (..., 2)."""
    mapped = places @ matrix[:, :2].T + matrix[:, 2]
    return np.asarray(mapped[..., :2] / mapped[..., 2:])


def _movement(start: FloatGrid, end: FloatGrid, shape: tuple[int, ...]) -> float:
    """Return the movement of the corners of a picture, as a share of its diagonal."""
    height, width = shape[1:]
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]]) * (width, height)
    there = map_places(end @ np.linalg.inv(start), corners)
    return float(np.linalg.norm(there - corners, axis=1).max() / np.hypot(width, height))


def _samples_per_px(patch: Patch, start: FloatGrid) -> float:
    """Return the samples of the lattice per pixel of the picture, in the middle."""
    row, column = (n // 2 for n in patch.grey.shape)
    near = patch.ideal_px[row : row + 2, column : column + 2]
    at = map_places(start, near)
    sides = at[0, 1] - at[0, 0], at[1, 0] - at[0, 0]
    return float(1 / np.sqrt(max(abs(np.linalg.det(np.stack(sides))), 1e-12)))


def _softened(picture: FloatArray, blur_px: float) -> FloatArray:
    return np.stack([cv2.GaussianBlur(plane, (0, 0), max(blur_px, 0.1)) for plane in picture])


def _blur_of(patch: Patch, picture: FloatArray, matrix: FloatGrid, step: float) -> float:
    """Return the blur with which the picture resembles the capture most."""
    alike = []
    for blur in BLURS:
        soft = _softened(picture, blur / step)
        alike.append(_compared(patch, soft, matrix, 2 * BLURS[-1] / step)[2])
    return BLURS[int(np.argmax(alike))]


def _compared(
    patch: Patch, soft: FloatArray, matrix: FloatGrid, margin: float
) -> tuple[FloatGrid, NDArray[np.bool_], float]:
    """Return the model of the capture, where it holds, and how they correlate."""
    grey = patch.grey
    at = map_places(matrix, patch.ideal_px)
    inside = _inside(at, patch.usable, soft, margin)
    planes = np.stack([_sampled(plane, at) for plane in soft])
    mixed, gain, offset = _mixture(grey, planes, inside)
    model = np.tensordot(mixed, planes, 1) * gain + offset
    return model, inside, _alike(grey, model, inside)


def _alike(grey: FloatArray, model: FloatGrid, inside: NDArray[np.bool_]) -> float:
    """Return the correlation of what smooth light does not explain."""
    some = _some(inside)
    terms = _terms(grey.shape)[:, some]
    observed, predicted = (
        part[some] - _least(terms, part[some].astype(np.float64)) @ terms for part in (grey, model)
    )
    sizes = np.sqrt((observed @ observed) * (predicted @ predicted))
    return float(observed @ predicted / sizes) if sizes > 0 else 0.0


def _some(inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return `MIXED_SAMPLES` or so of the samples inside."""
    every = 1 + np.count_nonzero(inside) // MIXED_SAMPLES
    some = np.zeros_like(inside)
    some.ravel()[np.flatnonzero(inside)[::every]] = True
    return some


def _terms(shape: tuple[int, ...]) -> FloatGrid:
    """Return the (7, h, w) smooth surfaces of which a gain, or stray light, is made."""
    y, x = np.meshgrid(*(np.linspace(-1, 1, n) for n in shape), indexing="ij")
    square = x * x + y * y
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y, square * square])


def _inside(
    at: FloatGrid, usable: NDArray[np.bool_], soft: FloatArray, margin: float
) -> NDArray[np.bool_]:
    height, width = soft.shape[1:]
    inside = (at >= margin).all(axis=-1) & (at <= np.array([width, height]) - 1 - margin).all(-1)
    inside &= usable
    if np.count_nonzero(inside) < LEAST_SAMPLES:
        raise DecodeError(
            f"{np.count_nonzero(inside)} samples of the picture are seen and not clipped, "
            f"{LEAST_SAMPLES} are needed: fill the capture with the screen, and expose less"
        )
    return np.asarray(inside)


def _mixture(
    grey: FloatArray, planes: FloatGrid, inside: NDArray[np.bool_]
) -> tuple[FloatGrid, FloatGrid, FloatGrid]:
    """Fit grey = gain * (colours . planes) + offset; gain and offset are smooth surfaces."""
    terms, some = _terms(grey.shape), _some(inside)
    values, gain = grey[some].astype(np.float64), np.ones(np.count_nonzero(some))
    here, surface = planes[:, some], terms[:, some]
    mixed, shapes = np.ones(3), np.zeros((2, len(terms)))
    for _ in range(3):
        mixed = _least(np.vstack([here * gain, surface]), values)[:3]
        bright = mixed @ here
        shapes = _least(np.vstack([surface * bright, surface]), values).reshape(2, -1)
        gain = shapes[0] @ surface
    gains, offsets = np.tensordot(shapes, terms, 1)
    return mixed, gains, offsets


def _least(columns: FloatGrid, values: FloatGrid) -> FloatGrid:
    """Solve for few numbers; a picture of one colour leaves some of them open."""
    return np.asarray(np.linalg.lstsq(columns @ columns.T, columns @ values, rcond=1e-12)[0])


def _refined(patch: Patch, soft: FloatArray, start: FloatGrid, margin: float) -> FloatGrid:
    """Return the homography at which the model misses the capture least."""
    ideal = patch.ideal_px.reshape(-1, 2)
    shape = (float(np.ptp(ideal[:, 1])) + 1, float(np.ptp(ideal[:, 0])) + 1)
    to_unit = _unit(shape, ideal.mean(axis=0))
    size = soft.shape[1:]
    from_unit = np.linalg.inv(_unit(size, (np.array(size[::-1]) - 1) / 2))
    matrix = np.linalg.inv(from_unit) @ start @ np.linalg.inv(to_unit)
    pull = from_unit[0, 0]
    for _ in range(_STEPS):
        matrix = matrix / matrix[2, 2]
        whole = from_unit @ matrix @ to_unit
        at = map_places(whole, patch.ideal_px)
        inside = _inside(at, patch.usable, soft, margin)
        step = _step((patch, soft, at, inside), matrix, to_unit, pull)
        matrix = matrix + np.append(step, 0.0).reshape(3, 3)
        if np.abs(step).max() * pull < _CONVERGED:
            break
    whole = from_unit @ (matrix / matrix[2, 2]) @ to_unit
    return np.asarray(whole / whole[2, 2])


def _step(
    arrays: tuple[Patch, FloatArray, FloatGrid, NDArray[np.bool_]],
    matrix: FloatGrid,
    to_unit: FloatGrid,
    pull: float,
) -> FloatGrid:
    """Return the (8,) change of the homography between places in -1..1.

    Args:
        arrays: The patch, the soft picture, where samples lie in it, and which count.
        matrix: (3, 3) so far, the last entry 1.
        to_unit: Places without distortion to -1..1.
        pull: Px of the picture in a unit.
    """
    patch, soft, at, inside = arrays
    planes = np.stack([_sampled(plane, at) for plane in soft])
    mixed, gain, offset = _mixture(patch.grey, planes, inside)
    mix = np.tensordot(mixed, soft, 1).astype(np.float32)
    along, down = (
        _sampled(cv2.Sobel(mix, cv2.CV_32F, dx, 1 - dx, scale=1 / 8), at)[inside]
        * gain[inside]
        * pull
        for dx in (1, 0)
    )
    model = (np.tensordot(mixed, planes, 1) * gain)[inside]
    rays = np.column_stack([patch.ideal_px[inside], np.ones(len(model))]) @ to_unit.T
    rays = rays / (rays @ matrix[2])[:, None]
    unit = rays @ matrix[:2].T
    lever = -(along * unit[:, 0] + down * unit[:, 1])
    columns = np.column_stack(
        [
            along[:, None] * rays,
            down[:, None] * rays,
            lever[:, None] * rays[:, :2],
            model,
            np.ones(len(model)),
        ]
    )
    rest = patch.grey[inside] - model - offset[inside]
    try:
        step = np.linalg.solve(columns.T @ columns, columns.T @ rest)
    except np.linalg.LinAlgError:
        raise DecodeError("the picture is too plain to be laid over its capture") from None
    return np.asarray(step[:8])


def _sampled(plane: FloatArray, at: FloatGrid) -> FloatGrid:
    x, y = (np.ascontiguousarray(at[..., n], dtype=np.float32) for n in (0, 1))
    values = cv2.remap(
        np.ascontiguousarray(plane), x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(values, dtype=np.float64)


def _unit(shape: tuple[float, ...], middle: FloatGrid) -> FloatGrid:
    """Return the map from px to about -1..1, of one scale along both axes."""
    half = max(shape) / 2
    return np.array([[1 / half, 0, -middle[0] / half], [0, 1 / half, -middle[1] / half], [0, 0, 1]])
