"""A reference picture aligned to a capture by a homography.

    both grey -> SIFT features -> matches -> RANSAC -> least squares on the pixels -> homography

The features find the plane, the pixels the last tenth of a pixel; gain and offset between the two
are fitted along. A homography is what two perspective views of one plane, such as a monitor,
differ by; distortion must be taken out of the capture before. (OpenCV's ECC was tried for the last
step: in float32 and unscaled positions it left pixels of error on blurred captures.)

References: Lowe 2004 (SIFT); Fischler and Bolles 1981 (RANSAC); Sun 2021, section 6.3.1.
"""

from dataclasses import dataclass, replace
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError

Matrix = NDArray[np.float64]
Values = NDArray[np.floating[Any]] | NDArray[np.signedinteger[Any]]

LEAST_MATCHES: Final = 12
LEAST_SHARE: Final = 0.2
WORK_SIDE_PX: Final = 2048
MOST_FEATURES: Final = 6000
_MATCH_RATIO: Final = 0.75
_RANSAC_PX: Final = 2.0
_STEPS: Final = 40
_CONVERGED_PX: Final = 2e-3
_SMOOTH_PX: Final = 1.0
_BLURS_PX: Final = (0.0, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6)
_LEAST_PIXELS: Final = 1000
_ROW: Final = 4096
_MARGIN_PX: Final = 24
LEAST_CORRELATION: Final = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Homography:
    """A map from pixels of the reference to pixels of the capture, pixel centres at integers.

    Attributes:
        matrix: (3, 3) on (x, y, 1), the last entry 1.
        matches: Feature pairs tried.
        inliers: Of these, pairs that agree.
        residual_px: Median distance of the agreeing pairs from the final map, in pixels of the
            capture; features of a blurred picture scatter by some tenths.
        correlation: Correlation of the two pictures after alignment, at most 1.
    """

    matrix: Matrix
    matches: int
    inliers: int
    residual_px: float
    correlation: float


def find_homography(reference: FloatArray, capture: FloatArray) -> Homography:
    """Estimate the homography from a reference to a capture of it.

    Args:
        reference: (h, w) grey, 0..1, with the curve of a display.
        capture: (m, n) grey, likewise; may be blurred, noisy and of another exposure.

    Raises:
        ContractError: If too few features agree or the pictures do not correlate.
    """
    scales = _work_scales(reference, capture)
    small = [_shrunk(p, s) for p, s in zip((reference, capture), scales, strict=True)]
    source, target = _matches(*small)
    start, agree = _ransac(source, target)
    matrix, correlation = _refined(small[0], small[1], start)
    distances = np.linalg.norm(map_points(matrix, source[agree]) - target[agree], axis=1)
    return Homography(
        matrix=_at_full_size(matrix, scales),
        matches=len(source),
        inliers=int(agree.sum()),
        residual_px=float(np.median(distances)) / scales[1],
        correlation=correlation,
    )


def refine_homography(
    homography: Homography,
    reference: FloatArray,
    capture: FloatArray,
    unknown: NDArray[np.bool_] | None = None,
) -> Homography:
    """Improve a homography with a reference that resembles the capture more; as `find_homography`.

    Args:
        homography: To begin with.
        reference: (h, w).
        capture: (m, n).
        unknown: (h, w) pixels of the reference that do not count; None for none.

    Raises:
        ContractError: If the pictures do not correlate.
    """
    scales = _work_scales(reference, capture)
    small = [_shrunk(p, s) for p, s in zip((reference, capture), scales, strict=True)]
    start = _scaling(scales[1]) @ homography.matrix @ np.linalg.inv(_scaling(scales[0]))
    counts = None if unknown is None else _shrunk(unknown.astype(np.float32), scales[0]) == 0
    matrix, correlation = _refined(small[0], small[1], start / start[2, 2], counts)
    return replace(homography, matrix=_at_full_size(matrix, scales), correlation=correlation)


def _work_scales(*pictures: FloatArray) -> tuple[float, float]:
    one, two = (min(1.0, WORK_SIDE_PX / max(p.shape)) for p in pictures)
    return one, two


def _at_full_size(matrix: Matrix, scales: tuple[float, float]) -> Matrix:
    full = np.linalg.inv(_scaling(scales[1])) @ matrix @ _scaling(scales[0])
    return np.asarray(full / full[2, 2])


def map_points(matrix: Matrix, points_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """Apply a (3, 3) homography to (n, 2) points x, y."""
    mapped = np.column_stack([points_px, np.ones(len(points_px))]) @ matrix.T
    return np.asarray(mapped[:, :2] / mapped[:, 2:])


def warp_to(
    picture: FloatArray, x_px: NDArray[np.float64], y_px: NDArray[np.float64]
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Sample a picture at given positions.

    Args:
        picture: (3, h, w).
        x_px: (m, n) columns.
        y_px: (m, n) rows.

    Returns:
        (3, m, n) by Lanczos interpolation, and (m, n) whether it lies inside with its filter.
    """
    height, width = picture.shape[1:]
    x, y = x_px.astype(np.float32), y_px.astype(np.float32)
    planes = [
        cv2.remap(np.ascontiguousarray(p), x, y, cv2.INTER_LANCZOS4, borderMode=cv2.BORDER_REFLECT)
        for p in picture
    ]
    reach = 4  # of the Lanczos filter
    inside = (x_px >= reach) & (x_px <= width - 1 - reach)
    inside &= (y_px >= reach) & (y_px <= height - 1 - reach)
    return np.stack(planes).astype(np.float32), inside


def _shrunk(picture: FloatArray, scale: float) -> FloatArray:
    if scale == 1:
        return np.ascontiguousarray(picture, dtype=np.float32)
    size = (round(picture.shape[1] * scale), round(picture.shape[0] * scale))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.float32)


def _scaling(scale: float) -> Matrix:
    """Return the map of pixel centres when a picture is resized by a factor."""
    shift = (scale - 1) / 2
    return np.array([[scale, 0, shift], [0, scale, shift], [0, 0, 1]])


def _matches(reference: FloatArray, capture: FloatArray) -> tuple[Matrix, Matrix]:
    """Return (n, 2) positions of features in the one and their likely partners in the other."""
    sift = cv2.SIFT.create(nfeatures=MOST_FEATURES)
    features = [sift.detectAndCompute(_to_bytes(p), None) for p in (reference, capture)]
    (points, words), (partners, other) = features
    if words is None or other is None or min(len(words), len(other)) < LEAST_MATCHES:
        raise ContractError(
            "reference and capture must show a textured plane; too few features were found "
            f"({len(points)} and {len(partners)}, at least {LEAST_MATCHES} are needed)"
        )
    pairs = cv2.BFMatcher(cv2.NORM_L2).knnMatch(words, other, k=2)
    good = [a for a, b in pairs if a.distance < _MATCH_RATIO * b.distance]
    if len(good) < LEAST_MATCHES:
        raise ContractError(
            f"{len(good)} features of the reference are found in the capture; at least "
            f"{LEAST_MATCHES} are needed: is it the right pair, is it sharp enough?"
        )
    source = np.array([points[m.queryIdx].pt for m in good], dtype=np.float64)
    target = np.array([partners[m.trainIdx].pt for m in good], dtype=np.float64)
    return source, target


def _to_bytes(picture: FloatArray) -> NDArray[np.uint8]:
    low, high = np.percentile(picture, (0.5, 99.5))
    stretched = (picture - low) / max(float(high - low), 1e-6)
    return np.asarray(255 * np.clip(stretched, 0, 1), dtype=np.uint8)


def _ransac(source: Matrix, target: Matrix) -> tuple[Matrix, NDArray[np.bool_]]:
    matrix, mask = cv2.findHomography(source, target, cv2.USAC_MAGSAC, _RANSAC_PX)
    agree = np.zeros(len(source), bool) if mask is None else mask.ravel() > 0
    if matrix is None or agree.sum() < max(LEAST_MATCHES, LEAST_SHARE * len(source)):
        raise ContractError(
            f"only {agree.sum()} of {len(source)} matches agree on one homography; at least "
            f"{LEAST_MATCHES} and {LEAST_SHARE:.0%} must: the picture may not be flat, or the "
            "distortion not be taken out"
        )
    return np.asarray(matrix, dtype=np.float64), agree


def _refined(
    reference: FloatArray,
    capture: FloatArray,
    start: Matrix,
    counts: NDArray[np.bool_] | None = None,
) -> tuple[Matrix, float]:
    """Minimise |capture(H x) - gain reference(x) - offset|^2 over the homography, in float64.

    Only pixels of the reference that count are compared. Positions are scaled to about -1..1, or
    the normal equations lose most of their digits.

    References: Lucas and Kanade 1981; Baker and Matthews 2004 (Gauss-Newton, forwards additive).
    """
    picture = cv2.GaussianBlur(capture, (0, 0), _SMOOTH_PX)
    slopes = [cv2.Sobel(picture, cv2.CV_32F, dx, 1 - dx, scale=1 / 8) for dx in (1, 0)]
    y, x = (v.ravel() for v in np.mgrid[: reference.shape[0], : reference.shape[1]])
    keep = _is_inner(x, y, reference.shape)
    keep = keep if counts is None else keep & counts.ravel()
    pixels = np.column_stack([x[keep], y[keep]]).astype(np.float64)
    values = _as_sharp(reference, picture, map_points(start, pixels), keep)
    to_unit = _unit(reference.shape)
    from_unit: Matrix = np.asarray(np.linalg.inv(_unit(capture.shape)), dtype=np.float64)
    grid = np.column_stack([pixels, np.ones(len(pixels))]) @ to_unit.T
    matrix = np.linalg.inv(from_unit) @ start @ np.linalg.inv(to_unit)
    for _ in range(_STEPS):
        matrix = matrix / matrix[2, 2]
        step, correlation = _newton_step(matrix, grid, values, (picture, *slopes), from_unit)
        matrix = matrix + np.append(step, 0.0).reshape(3, 3)
        if np.abs(step).max() * max(picture.shape) / 2 < _CONVERGED_PX:
            break
    else:
        raise ContractError("the pictures could not be aligned by their pixels: is it a plane?")
    if not correlation > LEAST_CORRELATION:
        raise ContractError(
            f"reference and capture correlate by {correlation:.2f} after alignment; more than "
            f"{LEAST_CORRELATION} is needed: is it the right pair?"
        )
    return from_unit @ matrix @ to_unit, correlation


def _as_sharp(
    reference: FloatArray, picture: FloatArray, at_px: Matrix, keep: NDArray[np.bool_]
) -> FloatArray:
    """Return the kept pixels of the reference, blurred until they resemble the picture the most.

    Against a sharper reference Gauss-Newton overshoots, and may leave.
    """
    inside = _is_inner(at_px[:, 0], at_px[:, 1], picture.shape)
    samples = _sampled(picture, at_px[inside].astype(np.float32))
    blurred = [
        cv2.GaussianBlur(reference, (0, 0), np.hypot(blur, _SMOOTH_PX)).ravel()[keep]
        for blur in _BLURS_PX
    ]
    alike = [np.corrcoef(one[inside], samples)[0, 1] for one in blurred]
    return np.asarray(blurred[int(np.nanargmax(alike))])


def _newton_step(
    matrix: Matrix,
    grid: Matrix,
    truth: FloatArray,
    pictures: tuple[FloatArray, FloatArray, FloatArray],
    from_unit: Matrix,
) -> tuple[Matrix, float]:
    """Return the (8,) change of the homography, and the correlation before it.

    Args:
        matrix: (3, 3) between positions in -1..1, the last entry 1.
        grid: (n, 3) positions in the reference.
        truth: (n,) the reference there.
        pictures: Capture, its slope along x, along y.
        from_unit: Positions in -1..1 to pixels of the capture.
    """
    mapped = grid @ matrix.T
    depth = mapped[:, 2:]
    unit = mapped[:, :2] / depth
    at = (unit * from_unit[[0, 1], [0, 1]] + from_unit[:2, 2]).astype(np.float32)
    keep = _is_inner(at[:, 0], at[:, 1], pictures[0].shape)
    if keep.sum() < _LEAST_PIXELS:
        raise ContractError("reference and capture hardly overlap; is it the right pair?")
    samples, along_x, along_y = (_sampled(p, at[keep]) for p in pictures)
    rays = grid[keep] / depth[keep]
    # d unit / d matrix, times the slope of the picture in units.
    pull_x, pull_y = along_x * from_unit[0, 0], along_y * from_unit[1, 1]
    lever = -(pull_x * unit[keep, 0] + pull_y * unit[keep, 1])
    columns = [
        pull_x[:, None] * rays,
        pull_y[:, None] * rays,
        lever[:, None] * rays[:, :2],
        -truth[keep, None],
        -np.ones((keep.sum(), 1)),
    ]
    system = np.concatenate(columns, axis=1)
    solution = np.linalg.solve(system.T @ system, -system.T @ samples)
    return solution[:8], float(np.corrcoef(samples, truth[keep])[0, 1])


def _sampled(picture: FloatArray, at_px: FloatArray) -> Matrix:
    """Sample (h, w) at (n, 2) positions, in rows that cv2.remap can hold."""
    rows = -(-len(at_px) // _ROW)
    padded = np.zeros((rows * _ROW, 2), dtype=np.float32)
    padded[: len(at_px)] = at_px
    x, y = (padded[:, i].reshape(rows, _ROW).copy() for i in range(2))
    values = cv2.remap(picture, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(values.ravel()[: len(at_px)], dtype=np.float64)


def _is_inner(x_px: Values, y_px: Values, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return which positions lie so far inside that a blurred border does not reach them."""
    height, width = shape
    inner = (x_px >= _MARGIN_PX) & (x_px <= width - 1 - _MARGIN_PX)
    return np.asarray(inner & (y_px >= _MARGIN_PX) & (y_px <= height - 1 - _MARGIN_PX))


def _unit(shape: tuple[int, ...]) -> Matrix:
    """Return the map from pixels to about -1..1, of one scale along both axes."""
    half = max(shape) / 2
    x, y = ((side - 1) / 2 for side in shape[::-1])
    return np.array([[1 / half, 0, -x / half], [0, 1 / half, -y / half], [0, 0, 1]])
