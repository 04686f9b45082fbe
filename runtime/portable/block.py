"""The graphs of a block: samples of a mosaic in, demosaicked and restored planes out.

    mosaic -> light, white balance, demosaic: one convolution -> haze cleared, where there is one
           -> taper -> spectrum -> filter -> out

Side b, n = b / 2. The block comes with two samples more on every side, for the demosaic; out is
what `camkit.runtime.bank` makes of it, times its window, so that the host only adds.
"""

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.stages.together import BAND, BAND_STEP
from camkit.runtime.bank.joint_colours import CORNER_FREQUENCY
from camkit.runtime.portable.block_noise import (
    BlockNoise,
    measured_light,
    noise_of,
    raised,
    shares,
)
from camkit.runtime.portable.demosaic_taps import MARGIN_PX, demosaicked
from camkit.runtime.portable.facts import CameraFacts
from camkit.runtime.portable.graph_builder import GraphBuilder, Value
from camkit.runtime.portable.haze_graph import cleared
from camkit.runtime.portable.light_graph import explain
from camkit.runtime.portable.mosaic_filter import restore_samples
from camkit.runtime.portable.place import fall_table
from camkit.runtime.portable.spectra import BlockShape, Spectrum, planes_of, spectrum
from camkit.runtime.portable.taper import tapered_block


def block_graph(facts: CameraFacts, *, mosaic: bool, lights: bool) -> GraphBuilder:
    """Return the graph of a block.

    Args:
        facts: Of the camera.
        mosaic: Whether it is restored from the samples of the mosaic.
        lights: Whether it explains clipped light.
    """
    name = "block" + ("_mosaic" if mosaic else "") + ("_lights" if lights else "")
    graph, shape = GraphBuilder(name), facts.shape
    side, n, q = shape.side, shape.n, shape.q
    samples = graph.input("mosaic", (side + 2 * MARGIN_PX,) * 2)
    phase = graph.input("phase", (1,), "int64")
    levels = graph.input("levels", (3,))
    gains = graph.input("gains", (3,))
    shot, read = graph.input("shot", (3,)), graph.input("read_variance", (3,))
    down, across = graph.input("window_y", (side,)), graph.input("window_x", (side,))
    transfer = tuple(graph.input(f"transfer_{part}", (3, 4, 2, q, q)) for part in ("re", "im"))
    assert len(transfer) == 2
    black, white, clip = levels.parts(0, 3)
    rgb = demosaicked(graph, samples - black, phase, gains / (white - black), shape)
    rise = None
    if facts.haze is not None:
        rgb = cleared(graph, rgb, shape, facts.haze.kernels.cell_px)
        rise = graph.input("noise_rise", (3,))
    tapered = tapered_block(graph, rgb, transfer, facts)
    noise = noise_of(facts, tapered, (shot, read, gains), rise)
    unlit, lit = tapered, None
    if lights:
        clipped = graph.node("GreaterOrEqual", samples, clip).cast("float32")
        inner = clipped.part(0, MARGIN_PX, MARGIN_PX + side).part(1, MARGIN_PX, MARGIN_PX + side)
        lit = explain(graph, facts, tapered, (transfer, noise), inner, wide=not mosaic)
        unlit, noise = lit.residual, raised(noise, lit.unexplained)
    if mosaic:
        sharp = restore_samples(graph, facts, unlit, noise, phase)
    else:
        sharp = _restore_planes(graph, facts, unlit, noise, transfer)
    planes = planes_of(graph, sharp, shape)
    if lit is not None:
        planes = planes + lit.lights
    both = graph.joined([rgb, planes], axis=0).shaped(1, 24, n, n)
    out = graph.node("DepthToSpace", both, blocksize=2, mode="CRD").shaped(6, side, side)
    graph.output("out", out * (down.shaped(side, 1) * across), (6, side, side))
    return graph


def _restore_planes(
    graph: GraphBuilder, facts: CameraFacts, planes: Value, noise: BlockNoise, transfer: Spectrum
) -> Spectrum:
    """Return the spectrum of the sharp block, see `camkit.runtime.bank.joint_colours`."""
    model, q = facts.together, facts.shape.q
    shape = (3, 4, 2, q, q)
    power, doubt = graph.input("power", shape), graph.input("doubt", shape)
    y_re, y_im = spectrum(graph, planes, facts.shape)
    g_re = transfer[0] * y_re + transfer[1] * y_im
    g_im = transfer[0] * y_im - transfer[1] * y_re
    share, scale, ratio = shares(facts, noise)
    if model.follow:
        k = _band_light(graph, facts, (g_re, g_im), (power, doubt), (share, scale, ratio))
        ratio = ratio / k**model.follow
    table = graph.table("noise", _noise_table(facts))
    weight = 1 / (ratio.shaped(3, 1, 1, 1, 1) * table + doubt)
    g_re, g_im, power_share = g_re * weight, g_im * weight, power * weight
    a = share.shaped(3, 1, 1, 1, 1)
    fall = graph.table("fall", fall_table(facts))
    rest = fall / (_sum(power_share) + 1.0)
    light_re, light_im = _sum(g_re / a) * rest, _sum(g_im / a) * rest
    shared = a - a * model.own * power_share
    prior = fall * model.own
    zero = np.zeros((1, 4, 2, q, q), np.bool_)
    zero[0, 0, :, 0, 0] = True
    x_re = graph.node("Where", zero, y_re, shared * light_re + g_re * prior)
    return x_re, shared * light_im + g_im * prior


def _sum(colours: Value) -> Value:
    red, green, blue = colours.parts(0, 3)
    return red + green + blue


def _noise_table(facts: CameraFacts) -> NDArray[np.float64]:
    """Return the noise for a variance of one, (3, 4, 2, q, q)."""
    model, squares = facts.together, facts.shape.squares
    lines = zip(model.noise, model.noise_rise, strict=True)
    logarithms = np.stack([noise + 4 * rise * squares for noise, rise in lines])
    return np.asarray(facts.shape.side**2 * np.exp(logarithms))


def _band_light(
    graph: GraphBuilder,
    facts: CameraFacts,
    crossed: Spectrum,
    place: tuple[Value, Value],
    block: tuple[Value, Value, Value],
) -> Value:
    """Return k from some frequencies of a band."""
    index = band_places(facts.shape)
    share, scale, ratio = block

    def band_samples(part: Value) -> Value:
        return part.shaped(3, -1).gather(index, 1)

    noise = graph.constant(_noise_table(facts).reshape(3, -1)[:, index])
    power, doubt = (band_samples(part) for part in place)
    weight = ratio.shaped(3, 1) * noise + doubt
    snr = (power / weight).sum(0)
    squares = facts.shape.squares.ravel()[index]
    fall = facts.shape.side**2 * (squares + CORNER_FREQUENCY**2) ** (-facts.together.exponent / 2)
    fall_seen = graph.constant(fall[None]) / (snr + 1.0)
    weight = weight * share.shaped(3, 1)
    light = [(band_samples(part) / weight).sum(0) * fall_seen for part in crossed]
    measured_power = light[0] * light[0] + light[1] * light[1]
    return measured_light(
        measured_power.sum(1).shaped(1), (fall_seen * snr).sum(1).shaped(1), scale
    )


def band_places(shape: BlockShape) -> NDArray[np.int64]:
    """Return where the measured frequencies lie in a flattened (4, 2, q, q) spectrum."""
    side = shape.side
    rows, columns = (part.ravel() % side for part in shape.frequencies)
    numbers = {
        (int(r), int(c)): i
        for i, (r, c) in reversed(list(enumerate(zip(rows, columns, strict=True))))
    }
    places = []
    for row in range(0, side, BAND_STEP):
        for column in range(0, side // 2 + 1, BAND_STEP):
            fy = (row if row <= side // 2 else row - side) / side
            if BAND[0] ** 2 <= fy * fy + (column / side) ** 2 <= BAND[1] ** 2:
                mirrored = (-row % side, -column % side)
                places.append(numbers.get((row, column), numbers.get(mirrored, -1)))
    assert min(places) >= 0
    return np.array(places, np.int64)
