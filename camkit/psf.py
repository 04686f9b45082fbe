"""The PSF of a camera, frozen on a grid of fields, depths and wavelengths, and its weights."""

from dataclasses import dataclass
from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.radial import RadialDistortion, RadialIllumination
from camkit.units import MM_PER_M

Symmetry = Literal["radial", "uniform", "grid"]

PSF_SUM_TOLERANCE: Final = 1e-4
DEPTH_RTOL: Final = 1e-6
"""A depth in metres is rarely the same number as in millimetres: 1.1 m is 1100.0000000000002 mm."""
LEAST_HEIGHT_MM: Final = 1e-6
MOST_HEIGHT_MM: Final = 1e6
"""Of the last field, where there are several."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FrozenPsf:
    """The PSF of a camera, frozen on a grid of field positions, depths and wavelengths.

    Its symmetry says what the fields are and how the kernels of other image points follow:

        radial    a lens of revolution: image points along +y of the sensor; other azimuths by
                  turning, and kernels are symmetric about their middle column
        uniform   one field: the same kernel everywhere, turned nowhere
        grid      image points on a grid over the sensor, row by row; blended between neighbours,
                  turned nowhere

    Attributes:
        kernels: (field, depth, wavelength, h, w) float32, >= 0, each sums to 1. As they fall on
            the sensor (scatter, not flipped), h and w odd, the centre pixel on the chief ray of
            the reference wavelength (so lateral colour lies in the kernels).
        field_heights_mm: (field,) float64: distance of the chief ray from the axis on the sensor;
            increasing from 0, unless the fields are a grid.
        depths_mm: (depth,) float64, object distances, increasing; inf is allowed.
        wavelengths_um: (wavelength,) float64, increasing.
        pixel_pitch_um: Pitch of the kernel samples, equal to that of the sensor.
        distortion: Radial distortion per channel.
        relative_illumination: (field,) float64 > 0, 1 on the axis.
        symmetry: See above.
        grid_x_mm: (column,) float64, increasing: positions of a grid, to the right of the axis.
        grid_y_mm: (row,) float64, increasing: positions of a grid, down the rows.
        focus_um: (shift,) float64, increasing, to both sides of 0: how far the sensor is moved
            away from the lens for `focus_kernels`; None where only the nominal focus is known.
        focus_kernels: (shift, field, depth, wavelength, h, w) float32, as `kernels`, of a camera
            whose sensor is moved so.
    """

    kernels: FloatArray
    field_heights_mm: NDArray[np.float64]
    depths_mm: NDArray[np.float64]
    wavelengths_um: NDArray[np.float64]
    pixel_pitch_um: float
    distortion: RadialDistortion
    relative_illumination: NDArray[np.float64]
    symmetry: Symmetry = "radial"
    grid_x_mm: NDArray[np.float64] | None = None
    grid_y_mm: NDArray[np.float64] | None = None
    focus_um: NDArray[np.float64] | None = None
    focus_kernels: FloatArray | None = None

    def __post_init__(self) -> None:
        self._check_kernels()
        self._check_axes()
        self._check_fields()
        self._check_focus()

    @property
    def radial_illumination(self) -> RadialIllumination | None:
        """Return relative illumination over the field height; None where fields are a grid."""
        if self.symmetry == "grid":
            return None
        return RadialIllumination(
            heights_mm=self.field_heights_mm, light=self.relative_illumination
        )

    def _check_kernels(self) -> None:
        if self.kernels.ndim != 5 or self.kernels.dtype != np.float32:
            raise ContractError(
                "kernels must be float32 (field, depth, wavelength, h, w); "
                f"got {self.kernels.dtype} {self.kernels.shape}"
            )
        _check_light(self.kernels)
        if self.kernels.shape[-1] % 2 == 0 or self.kernels.shape[-2] % 2 == 0:
            raise ContractError(f"kernel sides must be odd; got {self.kernels.shape[-2:]}")

    def _check_axes(self) -> None:
        axes = (self.field_heights_mm, self.depths_mm, self.wavelengths_um)
        if tuple(a.size for a in axes) != self.kernels.shape[:3]:
            raise ContractError(
                f"axes have {[a.size for a in axes]} samples, kernels {self.kernels.shape[:3]}"
            )
        rising = axes if self.symmetry != "grid" else axes[1:]
        if any((np.diff(a) <= 0).any() or np.isnan(a).any() for a in rising):
            raise ContractError("field heights, depths and wavelengths must increase")
        farthest = float(np.abs(self.field_heights_mm).max())
        if not (farthest == 0 or LEAST_HEIGHT_MM <= farthest <= MOST_HEIGHT_MM):
            raise ContractError(
                f"the last field lies {LEAST_HEIGHT_MM:g} to {MOST_HEIGHT_MM:g} mm from the axis; "
                f"got {farthest:g}"
            )
        if self.depths_mm[0] <= 0:
            raise ContractError(f"depths lie in front of the lens, > 0; got {self.depths_mm[0]}")
        if self.symmetry != "grid" and self.field_heights_mm[0] != 0:
            raise ContractError(f"the first field must be 0; got {self.field_heights_mm[0]}")
        light = self.relative_illumination
        if (
            light.shape != self.field_heights_mm.shape
            or not ((light > 0) & np.isfinite(light)).all()
        ):
            raise ContractError("relative illumination needs one finite value > 0 per field")
        if not (np.isfinite(self.pixel_pitch_um) and self.pixel_pitch_um > 0):
            raise ContractError(f"pixel_pitch_um must be > 0; got {self.pixel_pitch_um}")

    def _check_fields(self) -> None:
        x_mm, y_mm = self.grid_x_mm, self.grid_y_mm
        fields = self.field_heights_mm.size
        if self.symmetry not in get_args(Symmetry):
            names = ", ".join(get_args(Symmetry))
            raise ContractError(f"symmetry must be one of {names}; got {self.symmetry!r}")
        if self.symmetry != "grid":
            if x_mm is not None or y_mm is not None:
                raise ContractError("only fields of a grid have positions of a grid")
            if self.symmetry == "uniform" and fields != 1:
                raise ContractError(f"a uniform PSF has one field; got {fields}")
            return
        if x_mm is None or y_mm is None or x_mm.size * y_mm.size != fields:
            raise ContractError(f"a grid needs a position for each of its {fields} fields")
        if any((np.diff(a) <= 0).any() or not np.isfinite(a).all() for a in (x_mm, y_mm)):
            raise ContractError("the positions of a grid must be finite and increase")
        if not np.allclose(
            self.field_heights_mm, grid_heights_mm(x_mm, y_mm), rtol=1e-6, atol=1e-9
        ):
            raise ContractError("field heights must be the distances of the grid from the axis")

    def _check_focus(self) -> None:
        shifts_um, kernels = self.focus_um, self.focus_kernels
        if shifts_um is None and kernels is None:
            return
        if shifts_um is None or kernels is None:
            raise ContractError("kernels at other focus and their shifts come together")
        shape = (shifts_um.size, *self.kernels.shape)
        if kernels.dtype != np.float32 or kernels.shape != shape or shifts_um.ndim != 1:
            raise ContractError(
                f"kernels at {shifts_um.size} shifts of focus must be float32 {shape}; got "
                f"{kernels.dtype} {kernels.shape}"
            )
        both = bool((shifts_um < 0).any() and (shifts_um > 0).any())
        if (
            not (np.isfinite(shifts_um).all() and (np.diff(shifts_um) > 0).all() and both)
            or (shifts_um == 0).any()
        ):
            raise ContractError(
                f"shifts of focus must increase, to both sides of 0 and without it; got "
                f"{shifts_um.tolist()}"
            )
        _check_light(kernels)


def _check_light(kernels: FloatArray) -> None:
    """Refuse kernels that are not finite, negative or not of unit sum."""
    if not np.isfinite(kernels).all():
        raise ContractError("kernels hold NaN or inf; freeze the PSF again")
    if (kernels < 0).any():
        raise ContractError("kernels hold negative values; freeze the PSF again")
    sums = kernels.sum(axis=(-2, -1), dtype=np.float64)
    if np.abs(sums - 1).max(initial=0) > PSF_SUM_TOLERANCE:
        raise ContractError(
            f"every kernel must sum to 1; sums run {sums.min():.6f} to {sums.max():.6f}"
        )


def grid_heights_mm(x_mm: NDArray[np.float64], y_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distances (field,) of the positions of a grid from the axis, row by row."""
    return np.hypot(y_mm[:, None], x_mm).ravel()


def depth_weights(depths_mm: NDArray[np.float64], depth_mm: float | None) -> NDArray[np.float64]:
    """Return the share that every depth of a PSF has in the kernels of one object distance.

    Between two depths kernels are linear in 1 / depth, as defocus is. Without a distance all
    depths have the same share: the mean kernel.

    Args:
        depths_mm: (depth,), increasing; inf is allowed.
        depth_mm: Object distance; None for the mean.

    Returns:
        (depth,) float64, >= 0, sums to 1.

    Raises:
        ContractError: If the distance lies outside the depths, where nothing is known.
    """
    if depth_mm is None:
        return np.full(depths_mm.size, 1 / depths_mm.size)
    nearest_mm, farthest_mm = depths_mm[0] * (1 - DEPTH_RTOL), depths_mm[-1] * (1 + DEPTH_RTOL)
    if not nearest_mm <= depth_mm <= farthest_mm:
        names = [depth_name(known_mm) for known_mm in depths_mm]
        reach, instead = f"knows the one depth {names[0]}", ""
        if len(names) > 1:
            reach = f"reaches from {names[0]} to {names[-1]} ({', '.join(names)})"
            instead = " for the mean kernel of all"
        raise ContractError(
            f"the PSF {reach}; got {depth_name(depth_mm)}: give a depth it knows, or none{instead}"
        )
    index = np.arange(depths_mm.size)
    place = np.interp(1 / depth_mm, 1 / depths_mm[::-1], index[::-1])
    shares: NDArray[np.float64] = np.maximum(1 - np.abs(index - place), 0.0)
    return shares


def depth_name(depth_mm: float) -> str:
    """Return an object distance for people: "0.7 m" or "infinity"."""
    return "infinity" if np.isinf(depth_mm) else f"{depth_mm / MM_PER_M:g} m"


def focus_weights(shifts_um: NDArray[np.float64] | None, focus_um: float) -> NDArray[np.float64]:
    """Return the weights of the nominal kernels, and of those of every shift, at a focus.

    Kernels are linear between neighbouring shifts, so they stay >= 0 and of unit sum.

    Args:
        shifts_um: (shift,) of a PSF, increasing; None where only the nominal focus is known.
        focus_um: How far the sensor lies from its nominal place, away from the lens; 0 is nominal.

    Returns:
        (1 + shift,) float64, >= 0, sums to 1; the nominal kernels come first.

    Raises:
        ContractError: If the PSF does not reach so far.
    """
    shifts = np.zeros(0) if shifts_um is None else shifts_um
    if focus_um == 0:
        return np.concatenate([np.ones(1), np.zeros(shifts.size)])
    if not shifts.size:
        raise ContractError(
            "the PSF has the nominal focus alone, not that of the camera body: freeze it with "
            f"{option_text('focus_um')} and export the bundle again, or omit {option_text('unit')}"
        )
    if not shifts[0] <= focus_um <= shifts[-1]:
        raise ContractError(
            f"the PSF reaches from a focus of {shifts[0]:g} to {shifts[-1]:g} um; got "
            f"{focus_um:g} um: freeze it with a larger {option_text('focus_um')}, or focus the "
            "camera anew"
        )
    nominal = int((shifts < 0).sum())
    knots = np.insert(shifts, nominal, 0.0)
    hats = np.array([np.interp(focus_um, knots, unit) for unit in np.eye(knots.size)])
    return np.concatenate([hats[nominal : nominal + 1], np.delete(hats, nominal)])


@dataclass(frozen=True, slots=True, kw_only=True)
class PsfUncertainty:
    """The uncertainty of measured kernels, as standard deviations.

    Attributes:
        noise: Of a sample at the peak, relative to the peak; of others by the root of their light.
        shift_px: Of a colour against the mean of all colours, in samples.
        width: Relative, of the size of all kernels together.
    """

    noise: float = 0.01
    shift_px: float = 0.05
    width: float = 0.02

    def __post_init__(self) -> None:
        numbers = (self.noise, self.shift_px, self.width)
        if not all(0 <= number < 1 for number in numbers):
            raise ContractError(
                f"{option_text('uncertainty')} takes NOISE,SHIFT_PX,WIDTH, each in [0, 1); got "
                f"{numbers}"
            )
