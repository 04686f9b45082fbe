"""A package of somebody else's laboratory: a network family, a sensor and a PSF reader.

    networks    `lab_plain`: plain convolutions
    sensors     `LAB-1`: facts of a sensor, with their source
    readers     `.lab`: kernels as the laboratory's program writes them
    install     its entry points in a throw-away folder; a fixture for pytest

No file of camkit knows its names. A stage and a kind of camera of others are
`tests/lensless_camera` and `tests/toy_camera`.
"""

PACKAGE = "lab-package"
