"""Types of arrays that every floor names.

Signals are linear with 1.0 = white level (after black subtraction). Arrays are [y, x], pixel
centres at integers.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float32]

InputContract = Literal[
    "raw_bayer_v1", "linear_rgb_v1", "linear_planes_v1", "spad_counts_v1", "spad_histogram_v1"
]
"""raw_bayer_v1: (h, w) mosaic in DN; linear_rgb_v1: (3, h, w) and linear_planes_v1: (c, h, w)
linear, 1.0 = white level; spad_counts_v1: (h, w) and spad_histogram_v1: (t, h, w) photons."""
