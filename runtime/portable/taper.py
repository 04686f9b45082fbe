"""The ring of a block blended to its own blur, see `camkit.runtime.bank.blocks.taper_edges`."""

import numpy as np

from camkit.runtime.bank.blocks import taper_weights
from camkit.runtime.portable.facts import CameraFacts
from camkit.runtime.portable.graph_builder import GraphBuilder, Value
from camkit.runtime.portable.spectra import PHASES, BlockShape, Spectrum, product


def tapered_block(graph: GraphBuilder, rgb: Value, transfer: Spectrum, facts: CameraFacts) -> Value:
    """Return the (3, 4, n, n) block, tapered."""
    n, side = facts.shape.n, facts.shape.side
    small = BlockShape(side // 2)  # its planes are the 4x4 means of the block
    r, m = small.q, small.n
    cosines, sines = (part for part in small.waves(2.0 * np.arange(m)))
    means = np.kron(np.eye(m), np.full((1, 2), 0.5))
    repeats = np.kron(np.eye(m), np.ones((2, 1)))
    waves = np.concatenate([cosines, sines])
    mean = (rgb.sum(1) * 0.25).shaped(3, n, n)
    row_spectrum = (waves @ means) @ mean
    by_cosines = row_spectrum @ (means.T @ cosines.T)
    by_sines = row_spectrum @ (means.T @ sines.T)
    cc, sc = by_cosines.part(1, 0, r), by_cosines.part(1, r, 2 * r)
    cs, ss = by_sines.part(1, 0, r), by_sines.part(1, r, 2 * r)
    above = cc - ss, (sc + cs) * -1.0
    below = cc + ss, sc - cs
    low = [[half.shaped(3, r, r) for half in _low(part, r).parts(2, 2)] for part in transfer]
    re, im = product(above, (low[0][0], low[1][0]))
    re_below, im_below = product(below, (low[0][1], low[1][1]))
    # at the highest row of the small block the transfer of the negative frequency counts
    first, last = np.full((r, 1), 1.0), np.full((r, 1), 1.0)
    first[0] = last[0] = 0.5
    first[-1], last[-1] = 0.0, 1.0
    re, im, re_below, im_below = re * first, im * first, re_below * last, im_below * last
    column_weights = np.full((r, 1), 2.0)
    column_weights[[0, -1]] = 1
    wide_cosines = (cosines * column_weights) @ repeats.T / (m * m)
    wide_sines = (sines * column_weights) @ repeats.T / (m * m)
    columns: Value = (
        graph.joined([re + re_below, im_below - im], axis=1) @ wide_cosines
        + graph.joined([(im + im_below) * -1.0, re_below - re], axis=1) @ wide_sines
    )
    blurred = graph.constant(repeats @ waves.T) @ columns
    keep = taper_weights(side, min(facts.bank.overlap_px // 4, side // 4))
    keep = np.stack([keep[py::2, px::2] for py, px in PHASES])
    part: Value = blurred.shaped(3, 1, n, n)
    tapered: Value = part + (rgb - part) * graph.table("keep", keep)
    return tapered


def _low(part: Value, r: int) -> Value:
    return part.part(1, 0, 1).part(3, 0, r).part(4, 0, r)
