"""The tiny bundle with a lens of two configurations, whose kernels have other sides and depths."""

from pathlib import Path

import numpy as np

from camkit.bundle.frozen_optics import FrozenOptics, optics_of_states
from camkit.bundle.manifest import Manifest
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.states.lens_state import LensState
from camkit.bundle.writer import write_bundle
from tests.bundle_factory import tiny_manifest, tiny_members, tiny_psf, tiny_sensor
from tests.deep_bundle import FOCUS_MM, deep_psf


def two_states() -> FrozenOptics:
    """Return a wide state of one depth, and a long one of three."""
    wide = LensState(
        name="wide", psf=tiny_psf(), efl_mm=24.0, f_number=2.8, object_distance_mm=np.inf
    )
    long = LensState(
        name="long / near", psf=deep_psf(), efl_mm=70.0, f_number=4.0, object_distance_mm=FOCUS_MM
    )
    return optics_of_states((wide, long))


def states_manifest() -> Manifest:
    return tiny_manifest(
        name="zoom",
        format_version="2.12",
        sensor=tiny_sensor(320, 240),
        optics=two_states().entry(np.inf),
    )


def write_states_bundle(folder: Path, name: str = "zoom.camkit") -> Bundle:
    """Write and open the tiny bundle with both states and 320 x 240 pixels."""
    path = folder / name
    write_bundle(path, states_manifest(), tiny_members() | two_states().members)
    return open_bundle(path)
