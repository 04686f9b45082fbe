"""The PSFs that training samples are made with: copies of a camera, and the frozen one beside them.

A capture is blurred by the kernels of a copy, as a lens from the line would; the Wiener filter in
front of the network knows the frozen kernels only. Where a camera sees several depths, every copy
is there once per depth: whoever draws a copy draws its depth, and the frozen kernels are the mean
over the depths.
"""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.models_def.sensors.turned_kernels import turned_at
from camkit.runtime.bank.psf import FieldKernels


@dataclass(frozen=True, slots=True, kw_only=True)
class PsfBank:
    """Kernels of the colours for image points along +y, others by turning; or of a grid.

    Attributes:
        copies: (copy * depth, field, 3, h, w) float32, each sums to 1; the depths of a copy lie
            side by side, the last copies are for validation.
        copy_heights_mm: (field,) float64, increasing from 0.
        frozen: (field, 3, h, w) float32, what the bundle will hold.
        frozen_heights_mm: (field,) float64, increasing from 0.
        relative_illumination: (field,) float64 at `frozen_heights_mm`.
        depths: Of every copy.
        frozen_depths: (depth, field, 3, h, w) float32, what `frozen` is the mean of; None for one
            depth, or where nobody asks for them.
        validation_copies: How many of the copies are never trained on.
        grid_x_mm: (column,) positions of a grid, whose fields lie row by row, heights as they
            come, and whose kernels are turned nowhere; None for a lens of revolution.
        grid_y_mm: (row,) likewise.
    """

    copies: FloatArray
    copy_heights_mm: NDArray[np.float64]
    frozen: FloatArray
    frozen_heights_mm: NDArray[np.float64]
    relative_illumination: NDArray[np.float64]
    depths: int = 1
    frozen_depths: FloatArray | None = None
    validation_copies: int = 1
    grid_x_mm: NDArray[np.float64] | None = None
    grid_y_mm: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        count = self.copies.shape[0] if self.copies.ndim == 5 else 0
        validation = self.validation_copies
        if (
            min(self.depths, validation) < 1
            or count % self.depths
            or count < (1 + validation) * self.depths
        ):
            raise ContractError(
                "copies must be (copy times depth, field, 3, h, w), one to train on at least and "
                f"the last {validation} for validation; got {self.copies.shape} with {self.depths} "
                "depth(s)"
            )
        if self.frozen.ndim != 4 or self.copies.shape[2] != 3 or self.frozen.shape[1] != 3:
            raise ContractError(
                f"kernels need 3 colours; got {self.copies.shape}, {self.frozen.shape}"
            )

    @property
    def radius_px(self) -> int:
        """Return the radius of the copies' kernels."""
        return int(max(self.copies.shape[-2:])) // 2

    @property
    def training_copies(self) -> int:
        """Return the number of copies for training, each depth of a copy counted."""
        return int(self.copies.shape[0]) - self.depths * self.validation_copies

    def blur_kernels(self, copy: int, x_mm: float, y_mm: float) -> Tensor:
        """Return the (1, 3, h, w) kernels of one copy at a sensor position."""
        return self._at(self.copies[copy], self.copy_heights_mm, x_mm, y_mm)

    def frozen_kernels(self, x_mm: float, y_mm: float, depth: float | None = None) -> Tensor:
        """Return the (1, 3, h, w) frozen kernels at a sensor position.

        Args:
            x_mm: Position.
            y_mm: Likewise.
            depth: Number of the depth, linear between two; None for the mean kernel.

        Raises:
            ContractError: If the bank does not hold the depths apart.
        """
        if depth is not None and self.frozen_depths is None:
            raise ContractError("this bank does not hold the frozen kernels of its depths apart")
        frozen = self.frozen
        if depth is not None and self.frozen_depths is not None:
            near = min(int(depth), len(self.frozen_depths) - 1)
            frozen = self.frozen_depths[near]
            if depth > near:
                part = np.float32(depth - near)
                frozen = (1 - part) * frozen + part * self.frozen_depths[near + 1]
        return self._at(frozen, self.frozen_heights_mm, x_mm, y_mm)

    def _at(
        self, kernels: FloatArray, heights_mm: NDArray[np.float64], x_mm: float, y_mm: float
    ) -> Tensor:
        if self.grid_x_mm is None:
            place = (torch.tensor([mm], dtype=torch.float64) for mm in (x_mm, y_mm))
            return turned_at(torch.from_numpy(kernels), torch.from_numpy(heights_mm), *place)
        lookup = FieldKernels(
            kernels=kernels,
            field_heights_mm=heights_mm,
            symmetry="grid",
            grid_x_mm=self.grid_x_mm,
            grid_y_mm=self.grid_y_mm,
        )
        return torch.from_numpy(lookup.at(x_mm, y_mm))[None]

    def illumination_at(
        self, x_mm: NDArray[np.float64] | float, y_mm: NDArray[np.float64] | float
    ) -> NDArray[np.float64]:
        """Return the relative illumination at sensor positions."""
        light = self.relative_illumination
        if self.grid_x_mm is None or self.grid_y_mm is None:
            return np.asarray(np.interp(np.hypot(x_mm, y_mm), self.frozen_heights_mm, light))
        columns, rows = (
            np.stack([np.interp(at_mm, axis, unit) for unit in np.eye(axis.size)], axis=-1)
            for at_mm, axis in ((x_mm, self.grid_x_mm), (y_mm, self.grid_y_mm))
        )
        grid = light.reshape(self.grid_y_mm.size, self.grid_x_mm.size)
        return np.asarray(np.einsum("...r,rc,...c->...", rows, grid, columns))

    def digest(self) -> str:
        """Return the sha256 of all kernels and positions."""
        total = hashlib.sha256(b"" if self.depths == 1 else str(self.depths).encode())
        total.update(b"" if self.validation_copies == 1 else b"%d" % self.validation_copies)
        for name in _ARRAYS:
            total.update(np.ascontiguousarray(getattr(self, name)).tobytes())
        for array in (self.frozen_depths, self.grid_x_mm, self.grid_y_mm):
            if array is not None:
                total.update(np.ascontiguousarray(array).tobytes())
        return total.hexdigest()


_ARRAYS = (
    "copies",
    "copy_heights_mm",
    "frozen",
    "frozen_heights_mm",
    "relative_illumination",
)
_OPTIONAL = ("frozen_depths", "grid_x_mm", "grid_y_mm")


def write_bank(path: Path, bank: PsfBank) -> None:
    """Write a bank for another process."""
    arrays = {name: getattr(bank, name) for name in _ARRAYS}
    if bank.depths > 1:
        arrays["depths"] = np.array(bank.depths)
    if bank.validation_copies > 1:
        arrays["validation_copies"] = np.array(bank.validation_copies)
    for name in _OPTIONAL:
        if getattr(bank, name) is not None:
            arrays[name] = getattr(bank, name)
    np.savez(path, **arrays)


def read_bank(path: Path) -> PsfBank:
    """Read a file of `write_bank`."""
    with np.load(path, allow_pickle=False) as arrays:
        depths = int(arrays["depths"]) if "depths" in arrays else 1
        validation_copies = int(arrays["validation_copies"]) if "validation_copies" in arrays else 1
        optional = {name: arrays.get(name) for name in _OPTIONAL}
        required = {name: arrays[name] for name in _ARRAYS}
        return PsfBank(
            **required,
            depths=depths,
            validation_copies=validation_copies,
            **optional,
        )
