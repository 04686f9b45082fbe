"""The filter of a block from the samples of its mosaic, see `camkit.runtime.bank.mosaic`."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.runtime.bank.mosaic import BAND, GREENS, ROOT
from camkit.runtime.portable.block_noise import BlockNoise, measured_light, shares
from camkit.runtime.portable.facts import CameraFacts
from camkit.runtime.portable.graph_builder import GraphBuilder, Value
from camkit.runtime.portable.place import fall_table
from camkit.runtime.portable.spectra import PHASES, Spectrum, crossed, phase_spectra, product

OWN_COLOURS: Final = (0, 1, 1, 2)
"""Of R, the green beside it, the green below it and B."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MosaicPlace:
    """Terms of a place, see `camkit.runtime.bank.mosaic.MosaicTransfer`."""

    sharp: Spectrum
    low: Spectrum
    power: Value
    cross: Spectrum
    red_blue: Spectrum
    detour: Spectrum


def restore_samples(
    graph: GraphBuilder, facts: CameraFacts, planes: Value, noise: BlockNoise, phase: Value
) -> Spectrum:
    """Return the spectrum of the sharp block, (3, 4, 2, q, q)."""
    mosaic, model, shape = facts.bank.mosaic, facts.together, facts.shape
    assert mosaic is not None
    place = _place(graph, shape.q)
    share, scale, ratio = shares(facts, noise)
    data, means = _data(graph, facts, planes, phase, share)
    ratio = ratio * float(shape.n**2)
    k = _measured(graph, facts, data, place, (ratio, scale))
    if mosaic.smooth_follow:
        ratio = ratio * (mosaic.smooth_below / k).at_least(1.0) ** mosaic.smooth_follow
    if model.follow:
        ratio = ratio / k**model.follow
    solved = [part.parts(1, 4) for part in _solved(graph, data, place, ratio)]
    z = tuple(
        graph.joined(
            [
                graph.joined([red] * 4, axis=1),
                graph.joined([(plus, minus)[green - 1] for green in GREENS], axis=1),
                graph.joined([blue] * 4, axis=1),
            ],
            axis=0,
        )
        for red, plus, minus, blue in solved
    )
    terms = product(place.sharp, (z[0], z[1]))
    signs = np.array(
        [[(-1.0) ** (y * dy + x * dx) for dy, dx in PHASES] for y, x in PHASES]
    ).reshape(4, 1, 4, 1, 1, 1)
    factor = graph.constant(signs).gather(phase, 0).shaped(1, 4, 1, 1, 1)
    factor = factor * share.shaped(3, 1, 1, 1, 1)
    zero = np.zeros((1, 4, 2, shape.q, shape.q), np.bool_)
    zero[0, 0, :, 0, 0] = True
    re, im = ((part * model.own + part.sum(0)) * factor for part in terms)
    mean = means.shaped(3, 1, 1, 1, 1) * float(shape.side**2)
    return graph.node("Where", zero, mean, re), im


def _place(graph: GraphBuilder, q: int) -> MosaicPlace:
    def pair(name: str, *lengths: int) -> Spectrum:
        re, im = (graph.input(f"{name}_{part}", (*lengths, 2, q, q)) for part in ("re", "im"))
        return re, im

    return MosaicPlace(
        sharp=pair("sharp", 3, 4),
        low=pair("low", 1, 4),
        power=graph.input("power", (1, 4, 2, q, q)),
        cross=pair("cross", 2, 2),
        red_blue=pair("red_blue", 1, 1),
        detour=pair("detour", 1, 2),
    )


def _data(
    graph: GraphBuilder, facts: CameraFacts, planes: Value, phase: Value, share: Value
) -> tuple[Spectrum, Value]:
    """Return spectra of R, +, -, B over their colour's share, (1, 4, 2, q, q), and (3,) means."""
    shape = facts.shape
    phases = np.array([[p ^ other for other in range(4)] for p in range(4)])
    plane_phases = graph.constant(phases).gather(phase, 0).shaped(4)
    numbers = plane_phases + np.array([4 * c for c in OWN_COLOURS])
    samples = planes.shaped(12, shape.n, shape.n).gather(numbers, 0)
    spectra = phase_spectra(graph, samples, plane_phases, shape)
    red_mean, first, second, blue_mean = (
        (samples.sum(1, 2) * (1 / shape.n**2)).shaped(4).parts(0, 4)
    )
    means = graph.joined([red_mean, (first + second) * 0.5, blue_mean], axis=0)
    factors = (1 / share).gather(np.array(OWN_COLOURS), 0) * np.array([1, ROOT / 2, ROOT / 2, 1])
    weights = np.ones((1, 4, 2, shape.q, shape.q))
    weights[:, (0, 1, 3), :, 0, 0] = 0
    data = []
    for part in spectra:
        red, first, second, blue = part.parts(1, 4)
        parts = graph.joined([red, first + second, first - second, blue], axis=1)
        data.append(parts * factors.shaped(1, 4, 1, 1, 1) * weights)
    return (data[0], data[1]), means


def _solved(graph: GraphBuilder, data: Spectrum, place: MosaicPlace, ratio: Value) -> Spectrum:
    """Return (1, 4, 2, q, q): K and noise, inverted, times spectra of R, +, -, B."""
    noises = [one.shaped(1, 1, 1, 1, 1) for one in ratio.parts(0, 3)]
    power_red, *greens_power, power_blue = place.power.parts(1, 4)
    greens = 1 / (graph.joined(greens_power, axis=1) + noises[1])
    cross_power = place.cross[0] * place.cross[0] + place.cross[1] * place.cross[1]
    removed_red, removed_blue = (cross_power * greens).sum(1).parts(0, 2)
    rest_red = power_red + noises[0] - removed_red
    rest_blue = power_blue + noises[2] - removed_blue
    link = tuple(
        direct - (detour * greens).sum(1)
        for direct, detour in zip(place.red_blue, place.detour, strict=True)
    )
    weight = 1 / (rest_red * rest_blue - link[0] * link[0] - link[1] * link[1])
    link = link[0] * weight, link[1] * weight
    of_red, of_blue = rest_blue * weight, rest_red * weight
    green = [graph.joined(part.parts(1, 4)[1:3], axis=1) * greens for part in data]
    pull = [part.sum(1) for part in product(place.cross, (green[0], green[1]))]
    ends = [
        (part.parts(1, 4)[0] - one.parts(0, 2)[0], part.parts(1, 4)[3] - one.parts(0, 2)[1])
        for part, one in zip(data, pull, strict=True)
    ]
    red, blue = (ends[0][0], ends[1][0]), (ends[0][1], ends[1][1])
    by_blue, by_red = product(link, blue), crossed(red, link)
    solved_red = [of_red * one - other for one, other in zip(red, by_blue, strict=True)]
    solved_blue = [of_blue * one - other for one, other in zip(blue, by_red, strict=True)]
    both = tuple(graph.joined(pair, axis=0) for pair in zip(solved_red, solved_blue, strict=True))
    back = [part.sum(0) * greens for part in crossed((both[0], both[1]), place.cross)]
    parts = zip(solved_red, green, back, solved_blue, strict=True)
    re, im = (graph.joined([r, g - b_, b], axis=1) for r, g, b_, b in parts)
    return re, im


def _measured(
    graph: GraphBuilder,
    facts: CameraFacts,
    data: Spectrum,
    place: MosaicPlace,
    block: tuple[Value, Value],
) -> Value:
    """Return k, (1,), of the low alias in the whole of the band."""
    ratio, scale = block
    shape = facts.shape
    weights = _solved(graph, place.low, place, ratio)
    squares, rows = shape.squares[0], np.arange(shape.q)
    often = np.full((2, shape.q, shape.q), 2.0)
    often[:, :, 0] = 1
    often[:, rows == 0] *= 0.5  # it lies there with either sign
    inside = (squares >= BAND[0] ** 2) & (squares < BAND[1] ** 2)
    band = np.where(inside, fall_table(facts)[0] ** 2 * often, 0)[None, None]
    re, im = (part.sum(1) for part in crossed(data, weights))
    light = ((re * re + im * im) * band).sum(0, 1, 2, 3, 4).shaped(1)
    low = (place.low[0] * weights[0] + place.low[1] * weights[1]).sum(1) * band
    return measured_light(light, low.sum(0, 1, 2, 3, 4).shaped(1), scale)
