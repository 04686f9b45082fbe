"""The toy camera: a kind of camera of somebody else, which no file of camkit knows.

    recipe       its sensor, networks and data; the streaks that were measured of its optics
    networks     two in a row: one takes the noise away, one makes the picture twice as large
    models_def   its part of the design side
    install      an entry point in a throw-away folder; a fixture for pytest

A monochrome camera without a Wiener bank, behind optics that throw one-sided streaks which differ
over the field. What is true of it is true of any camera that brings its own folder.
"""

from typing import Final

from camkit.kinds import Kind

KIND: Final = Kind(
    name="toy",
    title="a grey camera with streaks, for tests",
    sensor="planes",
    stages=("linearise", "repair", "network", "network", "color"),
    metrics=("picture",),
    home="tests.toy_camera",
)
