"""A network darkens no lamp below white: in the colours of the camera, and of the output.

    camera colours -> at least what stands in front of the network, or white where that is brighter
    lamps          -> the same behind the colour matrix

A colour matrix subtracts colours from each other. Where a network raises those of a lamp apart,
each above white, one of them ends dark behind the matrix.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.colorimetry import Matrix, OutputColours
from camkit.noise import NoiseModel
from camkit.runtime.signal.stabilise import stabilise, stabilised_level, unstabilise

_COLOURS: Final = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class WhiteKeeper:
    """Raises the output of the network of one capture.

    Attributes:
        noise: By which planes are stabilised.
        scale: Divisor of the stabilising transform.
        white: (c, 1, 1) stabilised.
        bright: (c, 1, 1) stabilised: no lamp has less in all colours.
        colours: Those of the output; None where they are the planes' own.
    """

    noise: NoiseModel
    scale: float
    white: FloatArray
    bright: FloatArray
    colours: OutputColours | None

    def keep(self, output: FloatArray, front: FloatArray) -> None:
        """Raise an output in place.

        Args:
            output: (c, h, w) float32, stabilised.
            front: (c, h, w) float32, stabilised: what stands in front of the network.
        """
        np.maximum(output, np.minimum(front, self.white), out=output)
        if self.colours is None:
            return
        rows, columns = np.nonzero((front >= self.bright).any(axis=0))
        if not rows.size:
            return
        front_light = self.colours.of(self._light(front[:, rows, columns]))
        lamp = (front_light >= 1).any(axis=0)
        at = np.s_[:, rows[lamp], columns[lamp]]
        # what a network that explodes gives is looked at elsewhere
        with np.errstate(over="ignore", invalid="ignore"):
            light = self._light(output[at])
            raised = self.colours.raised(light, np.minimum(front_light[:, lamp], 1))
            stabilised = stabilise(raised[:, None], self.noise, scale=self.scale)[:, 0]
        output[at] = np.where((raised != light) & np.isfinite(stabilised), stabilised, output[at])

    def _light(self, stable: FloatArray) -> FloatArray:
        """Return the light of (c, n) stabilised values."""
        return unstabilise(stable[:, None], self.noise, scale=self.scale)[:, 0]


def white_keeper(noise: NoiseModel, scale: float, to_output: Matrix) -> WhiteKeeper:
    """Return the function that keeps lamps white.

    Args:
        noise: By which planes are stabilised.
        scale: Divisor of the stabilising transform.
        to_output: (3, 3) from balanced planes to the colours of the output; of no use for other
            numbers of channels.
    """
    channels = len(noise.shot)
    turned = channels == _COLOURS and not np.array_equal(to_output, np.eye(_COLOURS))
    # a colour of the output is at most so many times the brightest of the planes
    most = float(np.maximum(to_output, 0).sum(axis=1).max()) if turned else 1.0
    white, bright = (stabilised_level(level, noise, scale=scale) for level in (1.0, 1 / most))
    return WhiteKeeper(
        noise=noise,
        scale=scale,
        white=white,
        bright=bright,
        colours=OutputColours(to_output) if turned else None,
    )
