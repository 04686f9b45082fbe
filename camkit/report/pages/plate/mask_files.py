"""The masks that a plate is etched through, as images, and what each of them etches."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.etching import Etching, mask_layers
from camkit.models_def.optics.diffraction.plate import Plate
from camkit.runtime.output.part_file import write_together

MaskFormat = Literal["png", "tiff"]
WHITE: Final = 255
POLARITY: Final = "white: glass stays; black: glass is etched away to depth_um"


def etching_of(plate: Plate) -> Etching:
    """Return how a plate is etched.

    Raises:
        ContractError: If its file does not say.
    """
    if plate.etching is None:
        raise ContractError(
            f"plate {plate.name} has no table [etching]: state its range_um and levels, without "
            "which there are no masks"
        )
    return plate.etching


def mask_paths(plate: Plate, folder: Path, name: str, kind: MaskFormat) -> list[Path]:
    """Return the files of the masks, the shallowest first, and of their JSON.

    Raises:
        ContractError: If the plate is not etched.
    """
    count = etching_of(plate).masks
    return [
        *(folder / f"{name}-mask-{number}.{kind}" for number in range(1, count + 1)),
        folder / f"{name}-masks.json",
    ]


def write_masks(plate: Plate, folder: Path, name: str, kind: MaskFormat) -> dict[str, Any]:
    """Write the masks, one for each etch step, and NAME-masks.json; all of them or none.

    Args:
        plate: With its etching.
        folder: Made if it is not there.
        name: Of the files.
        kind: Of the images: one pixel a cell, black and white.

    Returns:
        What stands in the JSON.

    Raises:
        ContractError: If the plate is not etched.
    """
    etching = etching_of(plate)
    *paths, told_path = mask_paths(plate, folder, name, kind)
    layers = mask_layers(etching.level(plate.height_um), etching.levels).numpy()
    report: dict[str, Any] = {
        "name": plate.name,
        "glass": plate.glass,
        "cells": plate.height_um.shape[0],
        "cell_um": plate.cell_um,
        "diameter_mm": plate.bench.diameter_mm,
        "aperture": plate.bench.aperture,
        "levels": etching.levels,
        "step_um": etching.step_um,
        "polarity": POLARITY,
        "masks": mask_facts(paths, layers, etching.step_um),
    }
    images = {path: mask_image(layer, kind) for path, layer in zip(paths, layers, strict=True)}
    write_together({**images, told_path: (json.dumps(report, indent=2) + "\n").encode()})
    return report


def mask_facts(
    paths: Sequence[Path], layers: NDArray[np.bool_], step_um: float
) -> list[dict[str, Any]]:
    """Return file, depth and share of what is etched of every mask, the shallowest first."""
    return [
        {
            "file": path.name,
            "depth_um": step_um * 2**number,
            "etched_share": round(1 - float(layer.mean()), 6),
        }
        for number, (path, layer) in enumerate(zip(paths, layers, strict=True))
    ]


def mask_image(layer: NDArray[np.bool_], kind: MaskFormat) -> bytes:
    """Return an image file of a mask: a PNG of one bit, or a TIFF of eight."""
    import cv2

    picture = np.where(layer, np.uint8(WHITE), np.uint8(0))
    flags = [cv2.IMWRITE_PNG_BILEVEL, 1] if kind == "png" else []
    _, data = cv2.imencode(f".{kind}", picture, flags)
    return data.tobytes()
