"""A PSF as it was measured, by whatever light, and what is told of it."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.calibration.lattice import FloatGrid
from camkit.calibration.peak import Field
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.psf import FrozenPsf
from camkit.radial import RadialDistortion
from camkit.units import MM_PER_M

COLOURS: Final = ("blue", "green", "red")
WAVELENGTHS_UM: Final = (0.46, 0.54, 0.60)
CORE_SHARE_PX: Final = 3.0
FloatLine = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class PsfOptions:
    """The caller's options of a measurement.

    Attributes:
        side_px: Odd side of the kernels; None for as far as the light stands out of the noise.
        pixel_pitch_um: None for what the frames state.
        depth_m: Distance of the light.
        disc_px: Diameter of the light, as sharp as can be, in pixels; None for a point.
    """

    side_px: int | None = None
    pixel_pitch_um: float | None = None
    depth_m: float = np.inf
    disc_px: float | None = None

    def __post_init__(self) -> None:
        side, pitch, disc = self.side_px, self.pixel_pitch_um, self.disc_px
        if side is not None and (side < 3 or side % 2 == 0):
            raise ContractError(f"{option_text('side_px')} must be odd and >= 3; got {side}")
        if pitch is not None and not (np.isfinite(pitch) and pitch > 0):
            raise ContractError(f"{option_text('pixel_pitch_um')} must be > 0; got {pitch:g}")
        if not self.depth_m > 0:
            raise ContractError(f"{option_text('depth_m')} must be > 0; got {self.depth_m:g}")
        if disc is not None and not (np.isfinite(disc) and disc > 0):
            raise ContractError(f"{option_text('disc_px')} must be > 0; got {disc:g}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reblurred:
    """A target as it was seen, and as the measured PSF blurs it; 1 where it is bright.

    Attributes:
        distance_px: (n,) from the middle of a disc, or from an edge.
        captured: (n,) means.
        predicted: (n,) what the PSF says of them.
    """

    distance_px: FloatLine
    captured: FloatLine
    predicted: FloatLine

    @property
    def rest(self) -> float:
        """Return the root mean square of what is left."""
        return float(np.sqrt(np.square(self.captured - self.predicted).mean()))


@dataclass(frozen=True, slots=True, kw_only=True)
class ColourFacts:
    """The measured facts of one colour.

    Attributes:
        colour: Its name.
        wavelength_um: Under which it is written.
        core_share: Of its light within the crop, what lies within 3 px of the centre.
        peak_share: The same within 10 px.
        peak_share_error: Its standard error.
        offset_px: (x, y) of its core from that of green.
        noise_floor: Spread of the dark around, of the brightest sample, before noise is smoothed;
            None for an edge.
        reblurred: The target by this PSF; None for a point.
    """

    colour: str
    wavelength_um: float
    core_share: float
    peak_share: float
    peak_share_error: float
    offset_px: tuple[float, float]
    noise_floor: float | None = None
    reblurred: Reblurred | None = None

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON values."""
        record: dict[str, Any] = {
            "colour": self.colour,
            "wavelength_um": self.wavelength_um,
            "core_share": round(self.core_share, 5),
            "peak_share": round(self.peak_share, 5),
            "peak_share_error": float(f"{self.peak_share_error:.3g}"),
            "offset_px": [round(part, 4) for part in self.offset_px],
        }
        if self.noise_floor is not None:
            record["noise_floor"] = float(f"{self.noise_floor:.3g}")
        if self.reblurred is not None:
            record["residual"] = float(f"{self.reblurred.rest:.3g}")
        return record


@dataclass(frozen=True, slots=True, kw_only=True)
class RedSamples:
    """The light of red as its samples lie on the sensor.

    What is summed over many samples is not to be resampled.

    Attributes:
        light: (h, w) as far as the kernels reach, background taken off.
        pitch_um: Of these samples.
    """

    light: FloatGrid
    pitch_um: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredPsf:
    """A PSF as it was measured.

    Attributes:
        psf: One field, one depth, three colours as wavelengths.
        centre_px: (x, y) of the light in the frames.
        colours: Facts of each colour.
        fields: Every place that was measured.
        notes: What the user should know.
        filled_samples: Samples of the crop that no frame holds, taken from their neighbours.
        red: Of a point; None for other targets.
    """

    psf: FrozenPsf
    centre_px: tuple[float, float]
    colours: tuple[ColourFacts, ...]
    fields: tuple[Field, ...]
    notes: tuple[str, ...]
    filled_samples: int = 0
    red: RedSamples | None = None

    @property
    def side_px(self) -> int:
        """Return the side of the kernels."""
        return int(self.psf.kernels.shape[-1])


def core_share(kernel: FloatGrid) -> float:
    """Return the share of a (side, side) kernel of unit sum within 3 px of its middle."""
    offset = np.arange(kernel.shape[-1]) - kernel.shape[-1] // 2
    return float(kernel[np.hypot(offset[:, None], offset[None]) <= CORE_SHARE_PX].sum())


def frozen(kernels: FloatGrid, pitch_um: float, depth_m: float) -> FrozenPsf:
    """Return (colour, side, side) kernels of unit sum, blue, green, red, as a PSF of one place."""
    return FrozenPsf(
        kernels=np.ascontiguousarray(kernels[None, None], dtype=np.float32),
        field_heights_mm=np.zeros(1),
        depths_mm=np.array([depth_m * MM_PER_M]),
        wavelengths_um=np.array(WAVELENGTHS_UM),
        pixel_pitch_um=pitch_um,
        distortion=RadialDistortion(coefficients=np.array([[1.0, 0, 0, 0]]), radius_mm=1.0),
        relative_illumination=np.ones(1),
        symmetry="uniform",
    )
