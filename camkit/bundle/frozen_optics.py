"""Optics as their files hold them, kernels or streaks, and the kernels that both give.

psf.safetensors [+ haze.safetensors, or of several states] | streaks.safetensors
    -> FrozenOptics -> entry of the manifest, members, kernels
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from camkit.bundle.haze_file import haze_to_bytes
from camkit.bundle.optics import (
    HAZE,
    PSF,
    STREAKS,
    FrozenPsfOptics,
    HazyPsfOptics,
    StatesEntry,
    StreakEntry,
)
from camkit.bundle.psf_file import (
    STATES,
    UNCERTAINTY,
    psf_from_tensors,
    psf_to_bytes,
    read_optics_bytes,
    read_psf,
    read_tensors,
    with_source,
)
from camkit.bundle.states.lens_state import LensState, check_states, find_name
from camkit.bundle.states.state_tensors import states_from_tensors, states_to_bytes
from camkit.bundle.streak_file import streaks_from_tensors, streaks_to_bytes
from camkit.errors import ContractError
from camkit.haze import Haze
from camkit.psf import FrozenPsf
from camkit.radial import RadialDistortion
from camkit.streaks import StreakOptics

PROFILES: Final = "profiles"
"""The tensor that only streaks have."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FrozenOptics:
    """Optics that were frozen.

    Attributes:
        psf: Their kernels, each of sum 1.
        streaks: Core, arms and haze; None for optics that are known by kernels alone.
        haze: What lies beside the kernels, which are a core then; None where they are all.
        states: Of a lens with several configurations, all; the kernels are those of one.
        state: Name of that one; empty where there are none.
    """

    psf: FrozenPsf
    streaks: StreakOptics | None = None
    haze: Haze | None = None
    states: tuple[LensState, ...] = ()
    state: str = ""

    def __post_init__(self) -> None:
        """Refuse parts that do not belong together.

        Raises:
            ContractError: If the haze is not of the samples of the kernels, or lies beside streaks,
                or states do not fit each other.
        """
        if self.states:
            check_states(self.states)
            if self.streaks is not None or self.haze is not None:
                raise ContractError("optics with several configurations have no streaks or haze")
            if self.lens_state.psf is not self.psf:
                raise ContractError(f"the kernels are not those of configuration {self.state}")
        if self.haze is not None:
            if self.streaks is not None:
                raise ContractError("streaks have a haze of their own; leave the other out")
            self.haze.check_beside(self.psf)

    @property
    def lens_state(self) -> LensState:
        """The state of a lens with several whose kernels these are."""
        return next(state for state in self.states if state.name == self.state)

    def with_state(self, choice: str | int | None) -> "FrozenOptics":
        """Return the optics in one of their states, the first where none is named.

        Raises:
            ContractError: If there is no such state.
        """
        return optics_of_states(self.states, choice)

    @property
    def member_name(self) -> str:
        """Return the name of their member."""
        return PSF if self.streaks is None else STREAKS

    @property
    def member(self) -> tuple[str, bytes]:
        """Return the name and the bytes of their member."""
        if self.streaks is not None:
            return self.member_name, streaks_to_bytes(self.streaks)
        if self.states:
            return self.member_name, states_to_bytes(self.states)
        return self.member_name, psf_to_bytes(self.psf)

    @property
    def members(self) -> dict[str, bytes]:
        """Return the bytes of every member by name: that of the kernels, and the haze."""
        added = {} if self.haze is None else {HAZE: haze_to_bytes(self.haze)}
        return dict([self.member]) | added

    def entry(
        self, object_distance_mm: float
    ) -> FrozenPsfOptics | HazyPsfOptics | StatesEntry | StreakEntry:
        """Return the manifest's entry of these optics.

        Args:
            object_distance_mm: Distance of focus, may be inf; that of states is their own.
        """
        pitch_um = self.psf.pixel_pitch_um
        if self.states:
            object_distance_mm = self.states[0].object_distance_mm
        focus_mm = None if np.isinf(object_distance_mm) else object_distance_mm
        if self.streaks is not None:
            return StreakEntry(pixel_pitch_um=pitch_um, object_distance_mm=focus_mm)
        if self.states:
            return StatesEntry(
                configurations=tuple(state.name for state in self.states),
                pixel_pitch_um=pitch_um,
                symmetry=self.psf.symmetry,
                object_distance_mm=focus_mm,
            )
        if self.haze is not None:
            return HazyPsfOptics(
                pixel_pitch_um=pitch_um,
                cell_px=self.haze.cell_px,
                symmetry=self.psf.symmetry,
                object_distance_mm=focus_mm,
            )
        return FrozenPsfOptics(
            pixel_pitch_um=pitch_um, symmetry=self.psf.symmetry, object_distance_mm=focus_mm
        )


def optics_of_states(
    states: tuple[LensState, ...], choice: str | int | None = None
) -> FrozenOptics:
    """Return the optics of a lens with several configurations, in one of them.

    Args:
        states: At least one.
        choice: Name or number from 1; None for the first.

    Raises:
        ContractError: If there is no such state, or they do not fit each other.
    """
    check_states(states)
    psfs = {state.name: state.psf for state in states}
    name = find_name(list(psfs), "", choice)
    return FrozenOptics(psf=psfs[name], states=states, state=name)


def optics_from_bytes(data: bytes, *, what: str, channels: int) -> FrozenOptics:
    """Decode frozen optics, whichever of the three the file holds.

    Args:
        data: A whole safetensors file.
        what: Its name in the error message.
        channels: Of the sensor.

    Raises:
        BundleError: If it is damaged, or none of them.
    """
    tensors = read_tensors(data, what=what)
    if PROFILES in tensors:
        streaks = streaks_from_tensors(tensors, what=what)
        return FrozenOptics(psf=psf_of_streaks(streaks, channels), streaks=streaks)
    if STATES in tensors:
        return optics_of_states(states_from_tensors(tensors, what=what))
    return FrozenOptics(psf=psf_from_tensors(tensors, what=what))


def read_optics_file(path: Path, *, channels: int) -> FrozenOptics:
    """Read frozen optics from a file; see `optics_from_bytes`.

    Raises:
        BundleError: If it is missing, damaged, or neither.
    """
    data = read_optics_bytes(path, what="PSF")
    if UNCERTAINTY in read_tensors(data, what=str(path)):  # of a measured PSF; bundles hold none
        return FrozenOptics(psf=read_psf(path))
    return optics_from_bytes(data, what=str(path), channels=channels)


def write_optics_files(
    optics: FrozenOptics, path: Path, haze_path: Path | None = None, *, source: str = ""
) -> None:
    """Write frozen optics and the haze beside them, replacing files that are there.

    Args:
        optics: Kernels, or streaks.
        path: Receives them.
        haze_path: Receives the haze, which must be there then.
        source: Where the optics are from, for `camkit info`; empty where it is not said.
    """
    _, data = optics.member
    for file in (path, haze_path):
        if file is not None:
            file.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(with_source(data, source) if source else data)
    if haze_path is not None and optics.haze is not None:
        haze_path.write_bytes(haze_to_bytes(optics.haze))


def psf_of_streaks(streaks: StreakOptics, channels: int, *, bare: bool = False) -> FrozenPsf:
    """Return the dense kernels of streak optics, each of sum 1.

    Args:
        streaks: Core, arms and haze.
        channels: Of the sensor; none is distorted.
        bare: Of the lens without its plate.
    """
    kernels = streaks.dense(bare=bare)
    kernels /= kernels.sum(axis=(-2, -1), keepdims=True, dtype=np.float64)
    straight = np.tile(np.array([[1.0, 0.0, 0.0, 0.0]]), (channels, 1))
    return FrozenPsf(
        kernels=kernels[None],
        field_heights_mm=np.zeros(1),
        depths_mm=streaks.depths_mm,
        wavelengths_um=streaks.wavelengths_um,
        pixel_pitch_um=streaks.pixel_pitch_um,
        distortion=RadialDistortion(coefficients=straight, radius_mm=1.0),
        relative_illumination=np.ones(1),
        symmetry="uniform",
    )
