"""A real pair aligned: where each pixel of a capture lies in its reference, and in which colours.

    capture -> distortion out -> homography of the reference -> colours of the plane fitted

The reference is warped and the capture left alone, since networks work in sensor geometry.
References: Sun 2021, sections 6.2.1 and 6.3.1.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.sensor import ColorSensor
from camkit.colorimetry import apply_matrix, encode_srgb
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.fine_tuning.homography import (
    WORK_SIDE_PX,
    Homography,
    find_homography,
    map_points,
    refine_homography,
    warp_to,
)
from camkit.models_def.kinds.bayer.fine_tuning.pair_photographs import Photograph
from camkit.models_def.kinds.bayer.psf_bank import PsfBank
from camkit.radial import RadialDistortion
from camkit.runtime.geometry.distortion import distort_points, undistort_points
from camkit.units import to_mm

Points = NDArray[np.float64]

COLOUR_STEP_PX: Final = 8
LEAST_COLOUR_POINTS: Final = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class AlignedPair:
    """An aligned pair.

    Attributes:
        capture: (3, h, w) linear, 1.0 = white level.
        clipped: (h, w) where a colour of it clipped.
        reference: (3, m, n) linear light, in camera colours as captured.
        unknown: (m, n) where the light of the reference is not known.
        to_reference: (n, 2) pixels x, y of the capture -> pixels of the reference.
        illumination: (n, 2) pixels of the capture -> (n,) what the reference is multiplied by
            there.
        homography: From the reference to the capture as it would be without distortion.
    """

    capture: FloatArray
    clipped: NDArray[np.bool_]
    reference: FloatArray
    unknown: NDArray[np.bool_]
    to_reference: Callable[[Points], Points]
    illumination: Callable[[Points], NDArray[np.float64]]
    homography: Homography

    def warped(
        self, first_px: tuple[int, int], size_px: tuple[int, int]
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Return the reference as it lies in a rectangle of the capture.

        Args:
            first_px: (x, y) of the first pixel.
            size_px: (width, height).

        Returns:
            (3, height, width) light without illumination, and (height, width) whether it is known.
        """
        width, height = size_px
        grid = np.mgrid[0:height, 0:width][::-1].reshape(2, -1).T + np.array(first_px, np.float64)
        at = self.to_reference(grid).reshape(height, width, 2)
        light, inside = warp_to(self.reference, at[..., 0], at[..., 1])
        if self.unknown.any():
            x, y = (at[..., axis].astype(np.float32) for axis in range(2))
            inside &= cv2.remap(self.unknown.astype(np.float32), x, y, cv2.INTER_LINEAR) == 0
        return light, inside


class Aligner:
    """Aligns pairs of one camera; pixels x, y of a capture that covers the whole sensor."""

    def __init__(
        self, sensor: ColorSensor, bank: PsfBank, distortion: RadialDistortion | None
    ) -> None:
        """Store the sensor; without a distortion the lens counts as free of it."""
        self._sensor, self._bank, self._distortion = sensor, bank, distortion
        self._centre = np.array([sensor.width_px - 1, sensor.height_px - 1]) / 2
        self._pitch_mm = to_mm(sensor.pixel_pitch_um)

    def check_size(self, capture: FloatArray) -> None:
        """Refuse a (3, h, w) capture that does not cover the sensor.

        Raises:
            ContractError: Naming both sizes.
        """
        sensor = self._sensor
        if capture.shape[1:] != (sensor.height_px, sensor.width_px):
            raise ContractError(
                f"a capture must cover the sensor, {sensor.width_px}x{sensor.height_px} px; got "
                f"{capture.shape[2]}x{capture.shape[1]}"
            )

    def align(self, capture: Photograph, reference: Photograph) -> AlignedPair:
        """Align a pair whose reference a display showed.

        Args:
            capture: Linear camera colours.
            reference: Linear Rec.709, of any size.

        Raises:
            ContractError: If the capture has not the size of the sensor, or the two cannot be
                aligned.
        """
        self.check_size(capture.light)
        # One step of the lattice is a pixel of the picture that is matched.
        step = -(-max(capture.clipped.shape) // WORK_SIDE_PX)
        grey = self._ideal_grey(capture.light, step)
        homography = find_homography(display_coded(reference.light.mean(0)), display_coded(grey))
        pair = self._pair(capture, reference.light, homography, step)
        light = apply_matrix(self._fit_colours(pair), reference.light)
        # In the capture's own colours and in linear light, blur and noise are all that differs.
        homography = refine_homography(homography, light.mean(0), grey)
        return self._pair(capture, light, homography, step)

    def _pair(
        self, capture: Photograph, reference: FloatArray, homography: Homography, step: int
    ) -> AlignedPair:
        """Return a pair by a homography to every step-th pixel."""
        matrix = np.diag([step, step, 1.0]) @ homography.matrix
        matrix = matrix / matrix[2, 2]
        back = np.linalg.inv(matrix)

        def to_reference(points_px: Points) -> Points:
            return map_points(back, self._undistorted(points_px))

        full = replace(homography, matrix=matrix, residual_px=step * homography.residual_px)
        return AlignedPair(
            capture=capture.light,
            clipped=capture.clipped,
            reference=reference,
            unknown=np.zeros(reference.shape[1:], dtype=bool),
            to_reference=to_reference,
            illumination=self.illumination,
            homography=full,
        )

    def to_sensor_mm(self, points_px: Points) -> Points:
        """Return (n, 2) positions from the axis."""
        return (points_px - self._centre) * self._pitch_mm

    def illumination(self, points_px: Points) -> NDArray[np.float64]:
        """Return the (n,) relative illumination."""
        x_mm, y_mm = self.to_sensor_mm(points_px).T
        return self._bank.illumination_at(x_mm, y_mm)

    def _ideal_grey(self, capture: FloatArray, step: int) -> FloatArray:
        """Return every step-th pixel of the capture without distortion and vignetting, grey."""
        height, width = capture.shape[1:]
        grid = np.mgrid[0:height:step, 0:width:step][::-1].reshape(2, -1).T.astype(np.float64)
        points = self._distorted(grid)
        at = points.reshape(-(-height // step), -(-width // step), 2)
        colours, _ = warp_to(_smooth(capture, step), at[..., 0], at[..., 1])
        light = self.illumination(points).reshape(at.shape[:2])
        return np.asarray(colours.mean(0) / light, dtype=np.float32)

    def _distorted(self, points_px: Points) -> Points:
        """Return where ideal positions fall on the sensor, both in pixels of the capture."""
        return self._displaced(distort_points, points_px)

    def _undistorted(self, points_px: Points) -> Points:
        """Undo `_distorted`."""
        return self._displaced(undistort_points, points_px)

    def _displaced(
        self, move: Callable[[Points, RadialDistortion], Points], points_px: Points
    ) -> Points:
        if self._distortion is None:
            return points_px
        return self._centre + move(self.to_sensor_mm(points_px), self._distortion) / self._pitch_mm

    def _fit_colours(self, pair: AlignedPair) -> NDArray[np.float64]:
        """Fit the (3, 3) matrix from the reference's Rec.709 to camera colours as captured."""
        step = COLOUR_STEP_PX
        height, width = (side // step * step for side in pair.capture.shape[1:])
        capture = pair.capture[:, :height, :width]
        coarse = capture.reshape(3, height // step, step, width // step, step).mean((2, 4))
        clipped = pair.clipped[:height, :width]
        squares = clipped.reshape(height // step, step, width // step, step)
        rows, columns = np.mgrid[0 : height // step, 0 : width // step]
        points = np.stack([columns, rows], -1).reshape(-1, 2) * step + (step - 1) / 2.0
        at = pair.to_reference(points).reshape(*rows.shape, 2)
        # The reference is smoothed as far as one step of the capture reaches in it.
        reach = max(1, round(float(np.linalg.norm(at[0, 1] - at[0, 0]))))
        reference, inside = warp_to(_smooth(pair.reference, reach), at[..., 0], at[..., 1])
        # A step at the edge of the plane also holds what lies beside it.
        whole = cv2.erode(inside.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        good = whole & ~np.asarray(squares.any((1, 3)))
        if good.sum() < LEAST_COLOUR_POINTS:
            raise ContractError("the reference covers too little of the capture, or all is clipped")
        light = self.illumination(points).reshape(rows.shape)[good]
        solution, *_ = np.linalg.lstsq(
            (reference[:, good] * light).T, coarse[:, good].T, rcond=None
        )
        return np.asarray(solution.T, dtype=np.float64)


def _smooth(picture: FloatArray, side: int) -> FloatArray:
    """Average (3, h, w) over squares of at least `side`, odd: an even one would shift by half."""
    return np.stack([cv2.blur(plane, (side | 1, side | 1)) for plane in picture])


def display_coded(grey: FloatArray) -> FloatArray:
    """Return (h, w) with the curve of a display, stretched to the brightest light."""
    return encode_srgb(grey / max(float(np.percentile(grey, 99.5)), 1e-6))
