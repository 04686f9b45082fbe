"""How exactly bundles take the distortion of every entry of a lensfun database.

    python -m tools.lens.entries DB [--json] [--warped]

Each entry is converted for pictures of 6000x4000 px of the sensor with which it was measured, and
held against lensfun's formula along the radius. `--warped` also measures the map by which pictures
are warped, whose lattice is linear between nodes, along the top of the picture.
"""

import argparse
import json
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from camkit.bundle.optics import RadialEntry
from camkit.calibration.lensfun.database import Database, Lens, lens_of
from camkit.calibration.lensfun.models import FULL_FRAME_MM, Distortion, unit_mm
from camkit.calibration.lensfun.profile import Frame, missed_px
from camkit.errors import ContractError
from camkit.runtime.geometry.distortion import check_distortion
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.geometry.warp import LATTICE_PX, Warp
from tools.hdr.record import in_one_line

SIZE_PX: Final = (6000, 4000)


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """What became of a database.

    Attributes:
        entries: Of distortion.
        converted: That a bundle takes.
        refused: Lens, focal length and reason of the others.
        worst_px: The most by which a converted one misses lensfun's formula.
        worst_warped_px: Likewise of the map of pictures; None where it was not measured.
    """

    entries: int
    converted: int
    refused: tuple[str, ...]
    worst_px: float
    worst_warped_px: float | None


def entries_of(database: Database) -> Iterator[tuple[Lens, Distortion]]:
    """Return every entry of distortion with its lens."""
    for file, element in database.lenses():
        lens = lens_of(element, file)
        for entry in lens.distortion:
            yield lens, entry


def frame_for(lens: Lens) -> Frame:
    """Return pictures of the sensor with which a lens was measured."""
    pitch_um = 1000 * FULL_FRAME_MM / lens.crop_factor / math.hypot(*SIZE_PX)
    return Frame(size_px=SIZE_PX, pitch_um=pitch_um, crop_factor=lens.crop_factor, channels=1)


def summarise(database: Database, *, warped: bool = False) -> Summary:
    """Convert every entry."""
    refused: list[str] = []
    missed, bent, count = [0.0], [0.0], 0
    for lens, entry in entries_of(database):
        count += 1
        frame = frame_for(lens)
        radial = entry.to_radial(unit_mm(lens.crop_factor, lens.aspect) * frame.stretch, 1)
        try:
            check_distortion(radial.to_distortion(), frame.corner_radius_mm)
        except ContractError as error:
            refused.append(f"{lens.name}, {entry.focal_mm:g} mm: {str(error).split(';')[0]}")
            continue
        missed.append(missed_px(entry, radial, frame))
        if warped:
            bent.append(warped_px(entry, radial, frame))
    return Summary(
        entries=count,
        converted=count - len(refused),
        refused=tuple(refused),
        worst_px=max(missed),
        worst_warped_px=max(bent) if warped else None,
    )


def warped_px(entry: Distortion, radial: RadialEntry, frame: Frame) -> float:
    """Return by how many pixels a picture's map misses the formula at most, in its top rows."""
    width, height = frame.size_px
    window = SensorWindow(
        size_px=frame.size_px,
        origin_px=(0, 0),
        sensor_size_px=frame.size_px,
        pitch_um=frame.pitch_um,
    )
    nodes = Warp(radial.to_distortion(), window, to_sensor=False).lattice(0, 0, LATTICE_PX)
    size = (nodes.shape[1] * LATTICE_PX, nodes.shape[0] * LATTICE_PX)
    dense = cv2.resize(nodes.astype(np.float32), size, interpolation=cv2.INTER_LINEAR)
    dense = dense[LATTICE_PX : 2 * LATTICE_PX, LATTICE_PX : LATTICE_PX + width]
    middle = (np.array([width, height]) - 1) / 2
    y, x = np.mgrid[0:LATTICE_PX, 0:width]
    away = np.stack([x, y], axis=-1) - middle
    unit_px = radial.radius_mm / (frame.pitch_um * 1e-3)
    radius = np.hypot(away[..., 0], away[..., 1])
    placed = entry.placed(radius / unit_px) * unit_px
    wanted = middle + away * (placed / radius)[..., None]
    return float(np.hypot(*np.moveaxis(dense - wanted, -1, 0)).max())


@in_one_line
def main() -> None:
    """Print what became of a database."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("database", type=Path)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--warped", action="store_true")
    asked = parser.parse_args()
    found = summarise(Database(asked.database), warped=asked.warped)
    if asked.json:
        print(json.dumps(asdict(found)))
        return
    print(
        f"{found.entries} entries of distortion: {found.converted} converted, "
        f"{len(found.refused)} refused; worst {found.worst_px:.2g} px"
    )
    if found.worst_warped_px is not None:
        print(f"worst as warped: {found.worst_warped_px:.3f} px")
    for line in found.refused:
        print(f"  refused: {line}")


if __name__ == "__main__":
    main()
