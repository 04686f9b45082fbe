"""The optics of a camera, as a bundle states them: a tagged union.

Optics = FrozenPsfOptics    kernels, psf.safetensors        (psf_file.py)
       | HazyPsfOptics      core kernels, psf.safetensors, and haze, haze.safetensors (haze_file.py)
       | StatesEntry        kernels of several states of a lens, psf.safetensors (states/)
       | StreakEntry        core, arms and haze, streaks.safetensors    (streak_file.py)
       | LensProfile        distortion and illumination alone, in the manifest
"""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag, model_validator

from camkit.bundle.entry import Entry, NonNegative, Positive, Since
from camkit.bundle.states.lens_state import MOST_STATES
from camkit.errors import ContractError
from camkit.haze import LEAST_CELL_PX, MOST_CELL_PX
from camkit.psf import Symmetry
from camkit.radial import RadialDistortion, RadialIllumination

PSF: Final = "psf.safetensors"
STREAKS: Final = "streaks.safetensors"
HAZE: Final = "haze.safetensors"


class FrozenPsfOptics(Entry):
    """Optics known by their frozen PSF.

    Attributes:
        member: The file of the kernels; see camkit/bundle/psf_file.py.
        pixel_pitch_um: Pitch of the kernel samples.
        symmetry: How the kernels of other image points follow from those stored; see
            `camkit.psf.FrozenPsf`.
        object_distance_mm: Distance of focus from the first surface; None for infinity.
    """

    type: Literal["frozen_psf"] = "frozen_psf"
    member: Literal["psf.safetensors"] = PSF
    pixel_pitch_um: Positive
    symmetry: Symmetry = "radial"
    object_distance_mm: Positive | None = None


class HazyPsfOptics(Entry):
    """Optics whose light falls into a narrow core and a wide haze (format 2.7).

    Attributes:
        member: The file of the core kernels.
        haze_member: The file of the haze; see camkit/bundle/haze_file.py.
        pixel_pitch_um: Pitch of the core kernels' samples.
        cell_px: Side of the cells of the haze, in these samples.
        symmetry: Of both; see `FrozenPsfOptics`.
        object_distance_mm: Distance of focus; None for infinity.
    """

    since: ClassVar = Since((2, 7), "the optics have a haze")
    type: Literal["hazy_psf"] = "hazy_psf"
    member: Literal["psf.safetensors"] = PSF
    haze_member: Literal["haze.safetensors"] = HAZE
    pixel_pitch_um: Positive
    cell_px: Annotated[int, Field(ge=LEAST_CELL_PX, le=MOST_CELL_PX, multiple_of=2)]
    symmetry: Symmetry = "radial"
    object_distance_mm: Positive | None = None


class StatesEntry(Entry):
    """Optics known by a frozen PSF for each of several configurations (format 2.12).

    Attributes:
        member: The file of all; see camkit/bundle/states/state_tensors.py.
        configurations: Their names; the first is taken where none is named.
        pixel_pitch_um: Pitch of the samples of all kernels.
        symmetry: Of all; see `FrozenPsfOptics`.
        object_distance_mm: Distance of focus of the first; None for infinity.
    """

    since: ClassVar = Since((2, 12), "the optics have several configurations")
    type: Literal["lens_states"] = "lens_states"
    member: Literal["psf.safetensors"] = PSF
    configurations: Annotated[tuple[str, ...], Field(min_length=1, max_length=MOST_STATES)]
    pixel_pitch_um: Positive
    symmetry: Symmetry = "radial"
    object_distance_mm: Positive | None = None


class StreakEntry(Entry):
    """Optics that write streaks, the same everywhere (format 2.2).

    Attributes:
        member: The file of core, arms and haze; see camkit/bundle/streak_file.py.
        pixel_pitch_um: Pitch of its samples.
        symmetry: Streaks lie as they are, wherever in the picture.
        object_distance_mm: Distance of focus; None for infinity.
    """

    type: Literal["streaks"] = "streaks"
    member: Literal["streaks.safetensors"] = STREAKS
    pixel_pitch_um: Positive
    symmetry: Literal["uniform"] = "uniform"
    object_distance_mm: Positive | None = None


Factor = Annotated[float, Field(ge=-1e6, le=1e6)]


class RadialEntry(Entry):
    """Radial distortion, r_d = a0 r + a1 r^3 + a2 r^5 + a3 r^7 + b0 r^2 + b1 r^4 + b2 r^6.

    Attributes:
        coefficients: One row (a0, a1, a2, a3) for each channel of the sensor.
        even_coefficients: One row (b0, b1, b2) likewise; None for none.
        radius_mm: The unit of the ideal radius r and of r_d on the sensor.
    """

    coefficients: Annotated[
        tuple[tuple[Factor, Factor, Factor, Factor], ...], Field(min_length=1, max_length=256)
    ]
    even_coefficients: tuple[tuple[Factor, Factor, Factor], ...] | None = None
    radius_mm: Positive

    @model_validator(mode="after")
    def _check(self) -> "RadialEntry":
        even = self.even_coefficients
        if even is not None and len(even) != len(self.coefficients):
            raise ValueError(
                f"even_coefficients needs a row for each of {len(self.coefficients)}; got "
                f"{len(even)}"
            )
        return self

    def to_distortion(self) -> RadialDistortion:
        """Return it as arrays."""
        even = self.even_coefficients
        return RadialDistortion(
            coefficients=np.array(self.coefficients, dtype=np.float64),
            radius_mm=self.radius_mm,
            even_coefficients=None if even is None else np.array(even, dtype=np.float64),
        )


class IlluminationEntry(Entry):
    """Relative illumination over the distance from the optical axis.

    Attributes:
        heights_mm: Increasing from 0; between them it is linear in their square.
        relative_illumination: 1 on the axis, > 0.
    """

    heights_mm: Annotated[tuple[NonNegative, ...], Field(min_length=1, max_length=1024)]
    relative_illumination: tuple[Annotated[float, Field(gt=1e-6, le=1e6)], ...]

    @model_validator(mode="after")
    def _check(self) -> "IlluminationEntry":
        try:
            self.to_illumination()
        except ContractError as error:
            raise ValueError(str(error)) from error
        return self

    def to_illumination(self) -> RadialIllumination:
        """Return it as arrays."""
        return RadialIllumination(
            heights_mm=np.array(self.heights_mm, dtype=np.float64),
            light=np.array(self.relative_illumination, dtype=np.float64),
        )


class LensProfile(Entry):
    """A lens known by distortion and illumination alone; it has no kernels (format 2.6).

    Attributes:
        distortion: None where it is not known: no stage undistorts then.
        illumination: None likewise.
        object_distance_mm: Distance for which both hold; None for infinity.
    """

    since: ClassVar = Since((2, 6), "the optics are a lens profile")
    type: Literal["lens_profile"] = "lens_profile"
    distortion: RadialEntry | None = None
    illumination: IlluminationEntry | None = None
    object_distance_mm: Positive | None = None


def _type_of(value: Any) -> Any:
    """Return the type of optics; those that state none are kernels, as before there were others."""
    if isinstance(value, Mapping):
        return value.get("type", "frozen_psf")
    return getattr(value, "type", None)


Optics = Annotated[
    Annotated[FrozenPsfOptics, Tag("frozen_psf")]
    | Annotated[HazyPsfOptics, Tag("hazy_psf")]
    | Annotated[StatesEntry, Tag("lens_states")]
    | Annotated[StreakEntry, Tag("streaks")]
    | Annotated[LensProfile, Tag("lens_profile")],
    Discriminator(_type_of),
]
