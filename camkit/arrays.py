"""Types of arrays that every floor names.

Signals are linear with 1.0 = white level (after black subtraction). Arrays are [y, x], pixel
centres at integers.
"""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float32]
