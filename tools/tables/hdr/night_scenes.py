"""Scenes that are photographed, as `camkit bench --saturate 0.015` does, and their groups.

Night scenes are 512 px a side, of larger pictures the middle 1024 px are taken.
"""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.report.bench.known_captures import bench_scene, drawn_scene
from camkit.report.quality import Shot, list_set

SATURATED: Final = 0.015
ISO: Final = 100.0
LDR_LIMIT_DB: Final = 45.0
REAL: Final = ("CandleGlass", "esplanade", "st_fagans_interior_1k")
"""Pictures with a range far above white."""
NIGHT: Final = "night"
MOST_NIGHTS: Final = 4
"""Times as many night scenes are looked at as are wanted."""
GROUPS: Final = {
    "night": "night scenes, LDR <= 45 dB",
    "real": "CandleGlass, Esplanade, St Fagans, LDR <= 45 dB",
    "other": "other files, LDR <= 45 dB",
    "night_easy": "night scenes, LDR > 45 dB",
    "files_easy": "files, LDR > 45 dB",
}
EASY: Final = ("night_easy", "files_easy")


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """Something to photograph.

    Attributes:
        name: night:SEED, or a file's.
        number: Its place in the set.
        path: The file; None for a night scene.
    """

    name: str
    number: int
    path: Path | None = None

    def light(self, bundle: Bundle) -> FloatArray:
        """Return it exposed, (3, h, w) linear Rec.709.

        Raises:
            CamkitError: If it cannot be read, or no exposure saturates that much.
        """
        if self.path is None:
            return drawn_scene(self.name, bundle, SATURATED)
        return bench_scene(self.path, bundle, SATURATED)

    def shot(self) -> Shot:
        """Return where it is photographed, with which noise."""
        return Shot(
            set_name=NIGHT if self.path is None else self.path.parent.name,
            picture=Path(self.name),
            number=self.number,
            position=0,
            iso=ISO,
            psf="bundle",
        )

    def digest(self) -> str:
        """Return a hash of what it is."""
        content = b"" if self.path is None else self.path.read_bytes()
        return hashlib.sha256(self.name.encode() + content).hexdigest()

    def group(self, ldr_db: float) -> str:
        """Return the group into which it falls by the PSNR of the bare lens."""
        if ldr_db > LDR_LIMIT_DB:
            return EASY[self.path is not None]
        if self.path is None:
            return NIGHT
        return "real" if self.path.stem in REAL else "other"


def night_scenes() -> Iterator[Scene]:
    """Return the night scenes from the first seed on; none of them was trained on."""
    number = 0
    while True:
        yield Scene(name=f"{NIGHT}:{number}", number=number)
        number += 1


def file_scenes(folder: Path) -> tuple[Scene, ...]:
    """Return the pictures of a folder.

    Raises:
        ContractError: If there are none.
    """
    return tuple(
        Scene(name=path.name, number=number, path=path)
        for number, path in enumerate(list_set(folder))
    )
