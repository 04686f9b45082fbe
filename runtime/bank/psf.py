"""The PSF of an image point: colours weighted, heights blended, turned to the azimuth.

    FrozenPsf (field, depth, wavelength) -> color_kernels (field, 3) -> kernel_at (3) at (x, y)

Several depths are blended into one first: those beside the object distance, or all of them.

Kernels are stored for image points along +y (down the rows). A point in another direction gets
the kernel turned so that its outward direction stays outward. Everything is computed for the
quadrant x, y >= 0 and mirrored into the others, so mirrored points have mirrored bits.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.contracts import FloatArray, FrozenPsf, depth_weights
from camkit.errors import ContractError

FloatGrid = NDArray[np.float64]

PAD_PX: Final = 4
"""Zeros around a kernel that is turned: a gather beyond its border finds zeros in all its taps."""


def wavelength_weights(
    psf_wavelengths_um: FloatGrid, wavelengths_um: FloatGrid, response: FloatGrid
) -> FloatGrid:
    """Integrate the response of the colours against the PSF's wavelength samples.

    The PSF is taken as linear between its wavelengths and constant beyond them, the response as
    linear between its own and zero beyond them; the integral of their product is then exact.

    Args:
        psf_wavelengths_um: (wavelength,), increasing.
        wavelengths_um: (n,), increasing.
        response: (3, n) >= 0.

    Returns:
        (3, wavelength) weights; each row sums to 1.

    Raises:
        ContractError: If shapes disagree or a colour has no response.
    """
    if response.shape != (3, wavelengths_um.size):
        raise ContractError(f"response must be (3, {wavelengths_um.size}); got {response.shape}")
    if wavelengths_um.size == 1:
        weights = response * _hats(psf_wavelengths_um, wavelengths_um).T
    else:
        knots = np.union1d(psf_wavelengths_um, wavelengths_um)
        knots = knots[(knots >= wavelengths_um[0]) & (knots <= wavelengths_um[-1])]
        # Two Gauss points are exact for the cubic at most that two linear factors make.
        middle, half = (knots[1:] + knots[:-1]) / 2, np.diff(knots) / 2
        points = np.concatenate([middle - half / np.sqrt(3), middle + half / np.sqrt(3)])
        sensed = np.stack([np.interp(points, wavelengths_um, row) for row in response])
        weights = (sensed * np.tile(half, 2)) @ _hats(psf_wavelengths_um, points).T
    sums = weights.sum(axis=1, keepdims=True)
    if not (sums > 0).all():
        raise ContractError(f"every colour needs a response > 0; sums are {sums.ravel()}")
    return np.asarray(weights / sums, dtype=np.float64)


def _hats(knots_um: FloatGrid, at_um: FloatGrid) -> FloatGrid:
    """Give (knot, n): the linear interpolation weights of every knot at n points."""
    return np.stack([np.interp(at_um, knots_um, unit) for unit in np.eye(knots_um.size)])


def color_kernels(
    psf: FrozenPsf,
    wavelengths_um: FloatGrid,
    response: FloatGrid,
    *,
    depth_mm: float | None = None,
) -> FloatArray:
    """Weight the wavelength kernels into one kernel per field and colour.

    A lens of revolution is symmetric about the meridional plane, so the kernels are made
    symmetric about their middle column, which also takes half of the noise of the tracing.

    Args:
        psf: The frozen PSF.
        wavelengths_um: (n,) grid of the response.
        response: (3, n) response of R, G, B.
        depth_mm: Object distance, see `depth_weights`; None for the mean kernel over the depths.

    Returns:
        (field, 3, h, w) float32; each kernel sums to 1.

    Raises:
        ContractError: If the PSF does not reach the depth or the response does not fit.
    """
    weights = wavelength_weights(psf.wavelengths_um, wavelengths_um, response)
    mixed = np.tensordot(_at_depth(psf, depth_mm), weights, axes=([1], [1]))
    mixed = np.moveaxis(mixed, -1, 1)
    mixed = 0.5 * (mixed + mixed[..., ::-1])
    mixed /= mixed.sum(axis=(-2, -1), keepdims=True)
    return np.ascontiguousarray(mixed, dtype=np.float32)


def _at_depth(psf: FrozenPsf, depth_mm: float | None) -> FloatArray | FloatGrid:
    """Blend the depths; (field, wavelength, h, w)."""
    shares = depth_weights(psf.depths_mm, depth_mm)
    used = np.flatnonzero(shares)
    if used.size == 1:
        return psf.kernels[:, used[0]]
    return np.tensordot(psf.kernels[:, used], shares[used], axes=([1], [0]))


def kernel_at(
    kernels: FloatArray, field_heights_mm: FloatGrid, x_mm: float, y_mm: float
) -> FloatArray:
    """Give the kernel of an image point, turned so that its radial direction points outward.

    Linear in the field height (the last one holds beyond it), a Catmull-Rom gather for the turn,
    zero outside, negatives cut, normalised. On the axis nothing is turned, and neither is the PSF
    of a single field: one PSF for all places has no direction.

    Args:
        kernels: (field, 3, h, w) float32, stored for points along +y (down the rows), odd sides.
        field_heights_mm: (field,), increasing from 0.
        x_mm: Position from the axis, to the right.
        y_mm: Position from the axis, down the rows.

    Returns:
        (3, h, w) float32, each kernel sums to 1.

    Raises:
        ContractError: If the kernels and heights disagree.
    References: Keys 1981, cubic convolution with a = -1/2.
    """
    if kernels.ndim != 4 or kernels.shape[0] != field_heights_mm.size:
        raise ContractError(
            f"expected {field_heights_mm.size} fields of (3, h, w) kernels; got {kernels.shape}"
        )
    height_mm = float(np.hypot(x_mm, y_mm))
    kernel = _blend(kernels, field_heights_mm, height_mm)
    has_direction = field_heights_mm.size > 1
    if x_mm != 0.0 and has_direction:
        kernel = _turn(kernel, abs(x_mm) / height_mm, abs(y_mm) / height_mm)
    np.maximum(kernel, 0, out=kernel)
    # Float64 sums: a sum in another order must not move the result.
    kernel = (kernel / kernel.sum(axis=(-2, -1), keepdims=True, dtype=np.float64)).astype(
        np.float32
    )
    kernel = kernel[:, :, ::-1] if x_mm < 0 and has_direction else kernel
    kernel = kernel[:, ::-1] if y_mm < 0 and has_direction else kernel
    return np.ascontiguousarray(kernel)


def _blend(kernels: FloatArray, heights_mm: FloatGrid, height_mm: float) -> FloatArray:
    """Interpolate linearly in height; a new (3, h, w) array."""
    if heights_mm.size == 1:
        return np.array(kernels[0])
    low = int(np.clip(np.searchsorted(heights_mm, height_mm, "right") - 1, 0, heights_mm.size - 2))
    share = (height_mm - heights_mm[low]) / (heights_mm[low + 1] - heights_mm[low])
    share = np.float32(min(max(share, 0.0), 1.0))
    return np.asarray((1 - share) * kernels[low] + share * kernels[low + 1])


def _turn(kernel: FloatArray, out_x: float, out_y: float) -> FloatArray:
    """Turn a (3, h, w) kernel so that its +y points along the unit vector (out_x, out_y)."""
    c, h, w = kernel.shape
    dy, dx = np.mgrid[-(h // 2) : h // 2 + 1, -(w // 2) : w // 2 + 1].astype(np.float64)
    rows = dx * out_x + dy * out_y + h // 2
    cols = dx * out_y - dy * out_x + w // 2
    row0, col0 = np.floor(rows), np.floor(cols)
    row_weights, col_weights = (
        [weight.astype(np.float32) for weight in _catmull_rom(t)]
        for t in (rows - row0, cols - col0)
    )
    padded = np.pad(kernel, ((0, 0), (PAD_PX, PAD_PX), (PAD_PX, PAD_PX))).reshape(c, -1)
    width = w + 2 * PAD_PX
    first_row = np.clip(row0, 1 - PAD_PX, h + 1).astype(np.intp) + (PAD_PX - 1)
    first_col = np.clip(col0, 1 - PAD_PX, w + 1).astype(np.intp) + (PAD_PX - 1)
    first = first_row * width + first_col
    turned = np.zeros_like(kernel)
    for i in range(4):
        line = np.zeros_like(kernel)
        for j in range(4):
            tap = padded[:, i * width + j :].take(first, axis=1)
            tap *= col_weights[j]
            line += tap
        line *= row_weights[i]
        turned += line
    return turned


def _catmull_rom(t: FloatGrid) -> tuple[FloatGrid, FloatGrid, FloatGrid, FloatGrid]:
    """Give the weights of the samples -1, 0, 1, 2 for positions t in 0..1."""
    t2, t3 = t * t, t * t * t
    return (
        0.5 * (2 * t2 - t3 - t),
        0.5 * (3 * t3 - 5 * t2 + 2),
        0.5 * (4 * t2 - 3 * t3 + t),
        0.5 * (t3 - t2),
    )
