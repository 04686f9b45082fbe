"""Clipped light of a block explained before the filter, the block as a whole.

See `camkit.runtime.bank.lights`.
"""

from dataclasses import dataclass

import numpy as np

from camkit.runtime.bank.richardson_lucy import CLIPPED_REACH_PX, LEAST_SIGNAL, START_SHARE
from camkit.runtime.portable.block_noise import BlockNoise
from camkit.runtime.portable.facts import CameraFacts
from camkit.runtime.portable.graph_builder import GraphBuilder, Value
from camkit.runtime.portable.spectra import Spectrum, crossed, planes_of, product, spectrum


@dataclass(frozen=True, slots=True, kw_only=True)
class Lights:
    """The light around the clipped samples of a block.

    Attributes:
        lights: (3, 4, n, n) light, 0 away from clipped samples.
        left: (3, 4, n, n) what it leaves of the block, 0 where nothing is known.
        unexplained: (3,) mean of the squared light near them that it does not explain.
    """

    lights: Value
    residual: Value
    unexplained: Value


def explain(
    graph: GraphBuilder,
    facts: CameraFacts,
    planes: Value,
    place_and_noise: tuple[Spectrum, BlockNoise],
    clipped: Value,
    *,
    wide: bool,
) -> Lights:
    """Explain the clipped light of a block.

    Args:
        graph: To add to.
        facts: Of the camera.
        planes: (3, 4, n, n), tapered.
        place_and_noise: Transfer and noise of the block.
        clipped: (b, b), 1 where the sensor clipped, else 0.
        wide: Whether what the demosaic made of clipped samples is left out too.
    """
    (transfer, noise), shape, bank = place_and_noise, facts.shape, facts.bank
    assert bank.clip_reach_px is not None
    near = _phases(_nearness(graph, clipped, bank.clip_reach_px), shape.side)
    widened = _phases(_widened(graph, clipped, CLIPPED_REACH_PX), shape.side)

    def blurred(light: Value) -> Value:
        return planes_of(graph, product(spectrum(graph, light, shape), transfer), shape)

    background = (noise.read / noise.shot).shaped(3, 1, 1, 1)
    measured = (planes + background).at_least(LEAST_SIGNAL)
    mean = planes.sum(1, 2, 3) * (START_SHARE / shape.side**2)
    light = planes.at_least(mean.at_least(LEAST_SIGNAL))
    for _ in range(bank.clip_iterations):
        expected = blurred(light).relu() + background
        ratio = measured / expected.at_least(LEAST_SIGNAL)
        ratio = ratio + (1.0 - ratio).relu() * widened
        back = crossed(spectrum(graph, ratio, shape), transfer)
        step = planes_of(graph, back, shape).relu()
        light = light * (step * step if bank.clip_power == 2 else step**bank.clip_power)
    missed = (planes - blurred(light)) * (1.0 - widened)
    unexplained = (missed * missed * near).sum(1, 2, 3) * (1 / shape.side**2)
    lights = light * near
    unknown = widened if wide else _phases(clipped, shape.side)
    residual = (planes - blurred(lights)) * (1.0 - unknown)
    return Lights(lights=lights, residual=residual, unexplained=unexplained.shaped(3))


def _phases(plane: Value, side: int) -> Value:
    """Return (1, 4, n, n) of (b, b)."""
    whole = plane.shaped(1, 1, side, side)
    return whole.graph.node("SpaceToDepth", whole, blocksize=2)


def _widened(graph: GraphBuilder, clipped: Value, reach: int) -> Value:
    """Return the largest of squares around each sample."""
    whole = graph.node("Unsqueeze", clipped, np.array([0, 1], np.int64))
    size = 2 * reach + 1
    pooled = graph.node("MaxPool", whole, kernel_shape=[size, size], pads=[reach] * 4)
    return graph.node("Squeeze", pooled, np.array([0, 1], np.int64))


def _nearness(graph: GraphBuilder, clipped: Value, reach: int) -> Value:
    """Return 1 up to half the reach from clipped samples, falling smoothly to 0."""
    axes = np.array([0, 1], np.int64)
    line = graph.node("Unsqueeze", clipped, axes)
    widths = 1.0 - line  # distance along the row: how many widths hold no clipped sample
    for width in range(1, reach + 1):
        pads = [0, width, 0, width]
        pooled = graph.node("MaxPool", line, kernel_shape=[1, 2 * width + 1], pads=pads)
        widths = widths + (1.0 - pooled)
    squares = graph.node("Squeeze", widths * widths, axes)
    padding = np.array([reach, 0, reach, 0], np.int64)
    squares = graph.node("Pad", squares, padding, np.float32(4 * reach * reach))
    least: Value | None = None
    for step in range(-reach, reach + 1):
        shifted = squares.part(0, reach + step, 2**30 if step == reach else step - reach)
        shifted = shifted + float(step * step)
        least = shifted if least is None else least.at_most(shifted)
    assert least is not None
    distance = least.at_most(float(reach * reach)).sqrt()
    t = (2.0 - distance * (2 / reach)).clip(0.0, 1.0)
    return t * t * (3.0 - t * 2.0)
