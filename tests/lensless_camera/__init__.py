"""The lensless camera: a kind of somebody else, a stage of its own, no lens and no training.

    bundle    a photograph of a point light -> kernel -> bundle
    entry     its stage in a manifest: `lensless_admm`
    stage     what the stage does to a capture
    solver    the scene behind a mask, by ADMM, in numpy alone
    runtime   its part at use time: 16-bit TIFFs
    install   its entry points in a throw-away folder; a fixture for pytest

A mask or a diffuser lies close before a monochrome sensor, so that a point of the scene lights the
whole frame. The stage works on the whole frame at once, where those of camkit work in blocks.
"""

from typing import Final

from camkit.kinds import Kind

PACKAGE: Final = "lensless-camera"
KIND: Final = Kind(
    name="lensless",
    title="a grey camera behind a mask, for tests",
    sensor="planes",
    stages=("linearise", "lensless_admm", "color"),
    metrics=("picture",),
    home="tests.lensless_camera",
)
