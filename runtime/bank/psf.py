"""The PSF of an image point: channels weighted, fields blended, turned where optics are round.

    FrozenPsf (field, depth, wavelength) -> color_kernels -> FieldKernels (field, c) -> at(x, y)

Several depths are blended into one first: those beside the object distance, or all of them; and
before that, where a unit's own focus is known, the kernels beside it.

Kernels of a radial PSF are stored for image points along +y (down the rows). A point in another
direction gets the kernel turned so that its outward direction stays outward. Everything is computed
for the quadrant x, y >= 0 and mirrored into the others, so mirrored points have mirrored bits. No
other kernel is turned or mirrored: a streak lies where it was measured.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.psf import FrozenPsf, Symmetry, depth_weights, focus_weights

FloatGrid = NDArray[np.float64]

PAD_PX: Final = 3
"""Zeros around a kernel that is turned: as far as the taps of a sample lie beyond its border."""


def wavelength_weights(
    psf_wavelengths_um: FloatGrid, wavelengths_um: FloatGrid, response: FloatGrid
) -> FloatGrid:
    """Integrate the response of the colours against the PSF's wavelength samples.

    The PSF is taken as linear between its wavelengths and constant beyond them, the response as
    linear between its own and zero beyond them; the integral of their product is then exact.

    Args:
        psf_wavelengths_um: (wavelength,), increasing.
        wavelengths_um: (n,), increasing.
        response: (channel, n) >= 0.

    Returns:
        (channel, wavelength) weights; each row sums to 1.

    Raises:
        ContractError: If shapes disagree or a colour has no response.
    """
    if response.ndim != 2 or response.shape[1] != wavelengths_um.size:
        raise ContractError(
            f"response must be (channel, {wavelengths_um.size}); got {response.shape}"
        )
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
    """Return (knot, n): the linear interpolation weights of every knot at n points."""
    return np.stack([np.interp(at_um, knots_um, unit) for unit in np.eye(knots_um.size)])


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldKernels:
    """The kernels of the channels at the stored fields, and how others follow from them.

    Attributes:
        kernels: (field, c, h, w) float32, odd sides; each kernel sums to 1.
        field_heights_mm: (field,); increasing from 0 unless the fields are a grid.
        symmetry: Of the PSF; see `camkit.psf.FrozenPsf`.
        grid_x_mm: (column,), increasing; of a grid.
        grid_y_mm: (row,), increasing; of a grid.
    """

    kernels: FloatArray
    field_heights_mm: FloatGrid
    symmetry: Symmetry = "radial"
    grid_x_mm: FloatGrid | None = None
    grid_y_mm: FloatGrid | None = None

    def __post_init__(self) -> None:
        fields = self.field_heights_mm.size
        if self.kernels.ndim != 4 or self.kernels.shape[0] != fields:
            raise ContractError(
                f"expected {fields} fields of (c, h, w) kernels; got {self.kernels.shape}"
            )
        places = [axis.size for axis in (self.grid_y_mm, self.grid_x_mm) if axis is not None]
        if self.symmetry == "uniform" and fields != 1:
            raise ContractError(f"uniform kernels are of one field; got {fields}")
        if (len(places) == 2 and np.prod(places) == fields) != (self.symmetry == "grid"):
            raise ContractError(
                f"a grid, and nothing else, has a position for each of its {fields} fields; "
                f"got {self.symmetry} with positions {places}"
            )

    @property
    def turns(self) -> bool:
        """Return whether kernels are turned with the azimuth, and mirrored from one quadrant."""
        return self.symmetry == "radial" and self.field_heights_mm.size > 1

    def at(self, x_mm: float, y_mm: float) -> FloatArray:
        """Return the kernels of an image point.

        Args:
            x_mm: Position from the axis, to the right.
            y_mm: Position from the axis, down the rows.

        Returns:
            (c, h, w) float32, each kernel sums to 1.
        """
        if self.grid_x_mm is not None and self.grid_y_mm is not None:
            return _normalised(self.interpolate(self.kernels, x_mm, y_mm))
        return _kernel_at(self.kernels, self.field_heights_mm, x_mm, y_mm, turns=self.turns)

    def outward(self, x_mm: float, y_mm: float) -> FloatArray:
        """Return the kernels of an image point as rows and columns of its own: +y points outward.

        Args:
            x_mm: See `at`.
            y_mm: See `at`.

        Returns:
            (c, h, w) float32, each kernel sums to 1.
        """
        height_mm = float(np.hypot(x_mm, y_mm))
        if self.symmetry == "radial":
            return self.at(0.0, height_mm)
        kernels = self.at(x_mm, y_mm)
        if height_mm == 0:
            return kernels
        return _normalised(_turn(kernels, -x_mm / height_mm, y_mm / height_mm))

    def interpolate(self, values: FloatArray | FloatGrid, x_mm: float, y_mm: float) -> FloatArray:
        """Return what else is known at the fields at an image point: linear, as the kernels are.

        Args:
            values: (field, ...); nothing of them is turned.
            x_mm: See `at`.
            y_mm: See `at`.

        Returns:
            (...) float32.
        """
        if self.grid_x_mm is not None and self.grid_y_mm is not None:
            return _blend_grid(values, (self.grid_y_mm, self.grid_x_mm), (y_mm, x_mm))
        height_mm = float(np.hypot(x_mm, y_mm))
        return np.asarray(_blend(values, self.field_heights_mm, height_mm), np.float32)

    def scaled(self, ratio: float) -> "FieldKernels":
        """Return the kernels scaled about their centres, odd sides and sums of 1 kept.

        Args:
            ratio: New pixels per old pixel; > 0.

        Raises:
            ContractError: If the ratio is not.
        """
        if ratio <= 0:
            raise ContractError(f"the scale of kernels must be > 0; got {ratio}")
        return self if ratio == 1.0 else replace(self, kernels=_scaled(self.kernels, ratio))


def color_kernels(
    psf: FrozenPsf,
    wavelengths_um: FloatGrid,
    response: FloatGrid,
    *,
    depth_mm: float | None = None,
    focus_um: float = 0.0,
    share: FloatGrid | None = None,
) -> FieldKernels:
    """Weight the wavelength kernels into one kernel per field and channel.

    A lens of revolution is symmetric about the meridional plane, so the kernels of a radial PSF
    are made symmetric about their middle column, which also takes half of the noise of the tracing.

    Args:
        psf: The frozen PSF.
        wavelengths_um: (n,) grid of the response.
        response: (channel, n) response of the channels.
        depth_mm: Object distance, see `depth_weights`; None for the mean kernel over the depths.
        focus_um: How far the sensor lies from its nominal place, see `focus_weights`.
        share: (field, depth, wavelength): of the light that is in every kernel; None for all.

    Raises:
        ContractError: If the PSF does not reach depth or focus, or the response does not fit.
    """
    weights = wavelength_weights(psf.wavelengths_um, wavelengths_um, response)
    lit = _in_focus(psf, focus_um)
    lit = lit if share is None else lit * share[..., None, None]
    at_depth = _at_depth(lit, depth_weights(psf.depths_mm, depth_mm))
    mixed = np.tensordot(at_depth, weights, axes=([1], [1]))
    mixed = np.moveaxis(mixed, -1, 1)
    if psf.symmetry == "radial":
        mixed = 0.5 * (mixed + mixed[..., ::-1])
    mixed /= mixed.sum(axis=(-2, -1), keepdims=True)
    return FieldKernels(
        kernels=np.ascontiguousarray(mixed, dtype=np.float32),
        field_heights_mm=psf.field_heights_mm,
        symmetry=psf.symmetry,
        grid_x_mm=psf.grid_x_mm,
        grid_y_mm=psf.grid_y_mm,
    )


def _in_focus(psf: FrozenPsf, focus_um: float) -> FloatArray | FloatGrid:
    """Blend the shifts of focus; (field, depth, wavelength, h, w)."""
    nominal, *shares = focus_weights(psf.focus_um, focus_um)
    if psf.focus_kernels is None or nominal == 1:
        return psf.kernels
    blended: FloatGrid = nominal * psf.kernels
    for share, kernels in zip(shares, psf.focus_kernels, strict=True):
        if share > 0:
            blended = blended + share * kernels
    return blended


def _at_depth(kernels: FloatArray | FloatGrid, shares: FloatGrid) -> FloatArray | FloatGrid:
    """Blend the depths; (field, wavelength, h, w)."""
    depths = np.flatnonzero(shares)
    if depths.size == 1:
        return kernels[:, depths[0]]
    return np.tensordot(kernels[:, depths], shares[depths], axes=([1], [0]))


def _kernel_at(
    kernels: FloatArray,
    field_heights_mm: FloatGrid,
    x_mm: float,
    y_mm: float,
    *,
    turns: bool,
) -> FloatArray:
    """Return the kernel of an image point, turned so that its radial direction points outward.

    Linear in the field height (the last one holds beyond it), a Catmull-Rom gather for the turn,
    zero outside, negatives cut, normalised. On the axis nothing is turned.

    References: Keys 1981, cubic convolution with a = -1/2.
    """
    height_mm = float(np.hypot(x_mm, y_mm))
    kernel = _blend(kernels, field_heights_mm, height_mm)
    if x_mm != 0.0 and turns:
        kernel = _turn(kernel, abs(x_mm) / height_mm, abs(y_mm) / height_mm)
    kernel = _normalised(kernel)
    kernel = kernel[:, :, ::-1] if x_mm < 0 and turns else kernel
    kernel = kernel[:, ::-1] if y_mm < 0 and turns else kernel
    return np.ascontiguousarray(kernel)


def _normalised(kernel: FloatArray) -> FloatArray:
    """Cut negatives and scale each kernel to a sum of 1."""
    np.maximum(kernel, 0, out=kernel)
    # Float64 sums: a sum in another order must not move the result.
    total = kernel.sum(axis=(-2, -1), keepdims=True, dtype=np.float64)
    return np.asarray((kernel / total).astype(np.float32))


def _blend_grid(
    values: FloatArray | FloatGrid, axes_mm: tuple[FloatGrid, FloatGrid], at_mm: tuple[float, float]
) -> FloatArray:
    """Interpolate linearly between the four neighbours on a grid; its rim holds beyond it."""
    (row, down), (column, across) = (
        _neighbours(axis, at) for axis, at in zip(axes_mm, at_mm, strict=True)
    )
    columns = axes_mm[1].size
    total = np.zeros(values.shape[1:], dtype=np.float32)
    for y, x, share in (
        (row, column, (1 - down) * (1 - across)),
        (row, column + 1, (1 - down) * across),
        (row + 1, column, down * (1 - across)),
        (row + 1, column + 1, down * across),
    ):
        if share > 0:
            total += np.float32(share) * values[y * columns + x]
    return total


def _neighbours(positions_mm: FloatGrid, at_mm: float) -> tuple[int, float]:
    """Return the sample below a position, and the share of the one above it."""
    if positions_mm.size == 1:
        return 0, 0.0
    inside = min(max(at_mm, positions_mm[0]), positions_mm[-1])
    low = int(np.searchsorted(positions_mm, inside, "right")) - 1
    low = min(max(low, 0), positions_mm.size - 2)
    share = (inside - positions_mm[low]) / (positions_mm[low + 1] - positions_mm[low])
    return low, float(share)


def _blend(kernels: FloatArray | FloatGrid, heights_mm: FloatGrid, height_mm: float) -> FloatArray:
    """Interpolate linearly in height; a new (3, h, w) array."""
    if heights_mm.size == 1:
        return np.array(kernels[0])
    low = int(np.clip(np.searchsorted(heights_mm, height_mm, "right") - 1, 0, heights_mm.size - 2))
    share = (height_mm - heights_mm[low]) / (heights_mm[low + 1] - heights_mm[low])
    share = np.float32(min(max(share, 0.0), 1.0))
    return np.asarray((1 - share) * kernels[low] + share * kernels[low + 1])


def _turn(kernel: FloatArray, out_x: float, out_y: float) -> FloatArray:
    """Rotate a (3, h, w) kernel so that its +y points along the unit vector (out_x, out_y).

    Only samples with a tap where the kernel has light are computed; most kernels are zero almost
    everywhere.
    """
    c, h, w = kernel.shape
    dy = np.arange(-(h // 2), h // 2 + 1, dtype=np.float64)[:, None]
    dx = np.arange(-(w // 2), w // 2 + 1, dtype=np.float64)
    rows = dx * out_x + dy * out_y + h // 2
    cols = dx * out_y - dy * out_x + w // 2
    lit = np.flatnonzero(_has_taps(rows, kernel, axis=1) & _has_taps(cols, kernel, axis=2))
    rows, cols = rows.take(lit), cols.take(lit)
    row0, col0 = np.floor(rows), np.floor(cols)
    row_weights, col_weights = (_catmull_rom(t) for t in (rows - row0, cols - col0))
    padded = np.zeros((c, h + 2 * PAD_PX, w + 2 * PAD_PX), dtype=np.float32)
    padded[:, PAD_PX:-PAD_PX, PAD_PX:-PAD_PX] = kernel
    width = padded.shape[2]
    first = (row0.astype(np.intp) + (PAD_PX - 1)) * width + col0.astype(np.intp) + (PAD_PX - 1)
    first = first + np.arange(0, padded.size, padded[0].size)[:, None]
    flat = padded.reshape(-1)
    samples = np.zeros((c, lit.size), dtype=np.float32)
    for i in range(4):
        line = np.zeros_like(samples)
        for j in range(4):
            tap = flat[i * width + j :].take(first)
            tap *= col_weights[j]
            line += tap
        line *= row_weights[i]
        samples += line
    turned = np.zeros_like(kernel)
    turned.reshape(c, -1)[:, lit] = samples
    return turned


def _has_taps(places: FloatGrid, kernel: FloatArray, *, axis: int) -> NDArray[np.bool_]:
    """Return a mask of a kernel's axis: positions with taps between its first and last light."""
    light = np.flatnonzero(kernel.any(axis=(0, 3 - axis)))
    below, above = (light[0], light[-1]) if light.size else (0, kernel.shape[axis] - 1)
    mask = (places >= below - 2) & (places < above + 2)
    return np.asarray(mask, dtype=np.bool_)


def _catmull_rom(t: FloatGrid) -> list[FloatArray]:
    """Return the weights of the samples -1, 0, 1, 2 for positions t in 0..1.

    They are 1/2 of 2 t^2 - t^3 - t, 3 t^3 - 5 t^2 + 2, 4 t^2 - 3 t^3 + t and t^3 - t^2.
    """
    t2 = t * t
    t3 = t2 * t
    weights = [2 * t2, 3 * t3, 4 * t2, t3 - t2]
    weights[0] -= t3
    weights[0] -= t
    weights[1] -= 5 * t2
    weights[1] += 2
    weights[2] -= np.multiply(t3, 3, out=t3)
    weights[2] += t
    return [np.multiply(weight, 0.5, out=weight).astype(np.float32) for weight in weights]


def _scaled(kernels: FloatArray, ratio: float) -> FloatArray:
    """Scale (field, c, h, w) kernels."""
    import scipy.ndimage

    sides = kernels.shape[-2:]
    halves = [max(1, int(np.ceil((side // 2) * ratio))) for side in sides]
    # Blurring to the coarser grid first keeps energy that falls between the new samples.
    source = kernels
    if ratio < 1.0:
        sigma = 0.5 * np.sqrt(1 / ratio**2 - 1)
        source = scipy.ndimage.gaussian_filter(kernels, (0, 0, sigma, sigma), mode="constant")
    at = [
        np.arange(-half, half + 1) / ratio + side // 2
        for half, side in zip(halves, sides, strict=True)
    ]
    grid = np.meshgrid(*at, indexing="ij")
    scaled = np.stack(
        [
            scipy.ndimage.map_coordinates(k, grid, order=1, mode="constant")
            for k in source.reshape(-1, *sides)
        ]
    ).reshape(*kernels.shape[:2], *(2 * half + 1 for half in halves))
    return np.asarray(scaled / scaled.sum(axis=(-2, -1), keepdims=True), dtype=np.float32)
