"""Dark and flat frames of a sensor that is known: gain, read noise, fixed patterns, a lamp."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from camkit.runtime.metadata import Metadata
from camkit.runtime.output.dng import write_bayer_dng
from tests.dng_factory import grey_tags

BLACK, WHITE = 256, 4095
PRNU = 0.01
LAMP_DRIFT = 0.01
LEVELS = tuple(float(level) for level in np.geomspace(0.03, 0.7, 8))
Codes = NDArray[np.uint16]


def write_raw(path: Path, codes: Codes, iso: float | None, time_s: float | None = None, white: int = WHITE) -> None:  # noqa: E501 # fmt: skip
    """Write a mosaic as DNG that states ISO and time."""
    tags = grey_tags(
        black=BLACK * (white + 1) // (WHITE + 1),
        white=white,
        metadata=Metadata.believable(iso=iso, exposure_time_s=time_s),
    )
    write_bayer_dng(path, codes, tags=tags)


@dataclass
class Sensor:
    """A sensor of 12 bits at one ISO.

    Each pixel has its own response and offset; each frame its own light, as lamps drift.
    """

    rng: np.random.Generator
    gain_e_per_dn: float = 1.0
    read_noise_e: float = 1.0
    dsnu_e: float = 1.5
    prnu: float = PRNU
    black: float = BLACK
    side: int = 512
    drift: float = LAMP_DRIFT

    def __post_init__(self) -> None:
        shape = (self.side, self.side)
        pattern = np.random.default_rng(9)
        self._response = 1 + self.prnu * pattern.standard_normal(shape)
        self._offset_e = self.dsnu_e * pattern.standard_normal(shape)

    def frame(self, level: float, shape: NDArray[np.float64] | float = 1.0) -> Codes:
        """Give a frame at a level of white; `shape` is uneven light."""
        lamp = 1 + self.drift * self.rng.standard_normal()
        light_e = level * (WHITE - BLACK) * self.gain_e_per_dn * lamp * shape * self._response
        noise_e = self.read_noise_e * self.rng.standard_normal(self._response.shape)
        signal_e = self.rng.poisson(light_e) + self._offset_e + noise_e
        codes = np.rint(self.black + signal_e / self.gain_e_per_dn)
        return np.clip(codes, 0, WHITE).astype(np.uint16)

    def write(
        self, folder: Path, iso: float, levels: Sequence[float] = LEVELS, darks: int = 2
    ) -> tuple[list[Path], list[Path]]:
        """Write darks and pairs of flats."""
        dark = [folder / f"dark-{iso:g}-{n}.dng" for n in range(darks)]
        for path in dark:
            write_raw(path, self.frame(0.0), iso, 0.01)
        flat = [folder / f"flat-{iso:g}-{n}-{k}.dng" for n in range(len(levels)) for k in "ab"]
        for number, path in enumerate(flat):
            level = levels[number // 2]
            write_raw(path, self.frame(level), iso, level)
        return dark, flat
