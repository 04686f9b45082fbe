"""A model of colours restored together, for tests."""

from camkit.bundle.stages import Together
from camkit.bundle.stages.together import Spread

SPREAD = Spread(
    heights_mm=(0.0, 10.0),
    frequencies=(0.0, 0.1, 0.25, 0.5),
    variance=(
        ((0.0, 2e-3, 1e-3, 0.0), (0.0, 3e-3, 1e-3, 1e-4), (0.0, 5e-3, 2e-3, 1e-3)),
        ((0.0, 1e-3, 0.0, 0.0), (0.0, 1e-3, 5e-4, 0.0), (0.0, 2e-3, 1e-3, 1e-4)),
    ),
)
TOGETHER = Together(
    noise=(1.6, 0.5, 1.5),
    noise_rise=(1.4, 0.7, 1.5),
    scale=2e-3,
    exponent=2.46,
    follow=0.5,
    own=0.13,
    mistrust=3.4,
    spread=SPREAD,
)
