"""Methods as functions of a developed capture: linear planes in, linear planes out, on one thread.

    developed planes --> bank --> stabilised --> network (ONNX) --> light bound --> linear
                     -----------> stabilised --> network (ONNX) -----------------> linear
                     --> blocks with the kernels of their places --> network (torch) --> linear

Development and colours are the same for all methods and are no part of this: what is judged goes
through `finish_planes`, what is timed is the function alone.
"""

from collections.abc import Callable
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from camkit.arrays import FloatArray
from camkit.bundle.light_bound import BRIGHT
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Network, Wiener
from camkit.runtime.bank.baselines import restoration_bank
from camkit.runtime.bank.blocks import Block, BlockBank, BlockFilter
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.light_bound import keep_share
from camkit.runtime.network.light_keeper import LightKeeper
from camkit.runtime.network.white_keeper import white_keeper
from camkit.runtime.signal.stabilise import stabilise, stabilised_level, unstabilise
from tools.capture.simulated import color_sensor, rec709_of
from tools.comparison.peers import LocalCapture
from tools.methods.kernel_networks import Blurred

BLOCK_PX: Final = 384
OVERLAP_PX: Final = 96
"""Of the blocks of networks that know the blur: as large as the parts of the classical methods."""
SIDE_PX: Final = 16
"""Pictures are mirrored to a multiple, so that every network takes them."""

PlaneMethod = Callable[[LocalCapture], FloatArray]
"""A developed capture -> (3, h, w) linear, white balanced, vignetting still in."""
Run = Callable[[FloatArray], FloatArray]
"""(channels, h, w) stabilised -> (3, h, w) stabilised."""


def bank_method(bundle: Bundle) -> PlaneMethod:
    """Return the Wiener bank of a bundle."""
    (entry,) = bundle.manifest.stages_of(Wiener)

    def restore(capture: LocalCapture) -> FloatArray:
        bank = restoration_bank(capture.psf, entry, capture.noise)
        return bank.restore_array(capture.planes, capture.saturated)

    return restore


def behind_bank(bundle: Bundle, run: Run) -> PlaneMethod:
    """Return a network behind the bank, with the bound on light of the bundle behind it."""
    bank, (entry,) = bank_method(bundle), bundle.manifest.stages_of(Network)
    to_rec709 = rec709_of(color_sensor(bundle))

    def restore(capture: LocalCapture) -> FloatArray:
        noise, scale = capture.noise, entry.scale
        planes = [stabilise(x, noise, scale=scale) for x in (capture.planes, bank(capture))]
        share = None if capture.saturated is None else keep_share(capture.saturated)
        if share is not None:
            planes.append(share[None])
        stack = _mirrored(np.concatenate(planes))
        output = run(stack[:6])
        keeps_bright = entry.light is not None and entry.light.keeps_bright
        keeper = LightKeeper(
            front=slice(3, 6),
            kept_channel=None if share is None else 6,
            bound=entry.light,
            measured=True,
            strength=1,
            scale=scale,
            bright=stabilised_level(BRIGHT, noise, scale=scale)[:, 0, 0] if keeps_bright else None,
            white=white_keeper(noise, scale, to_rec709) if entry.keeps_white else None,
        )
        keeper(output, stack, (0, 0, *output.shape[1:]))
        return unstabilise(_cut(output, capture), noise, scale=scale)

    return restore


def on_capture(scale: float, run: Run) -> PlaneMethod:
    """Return a network that sees the capture alone."""

    def restore(capture: LocalCapture) -> FloatArray:
        stable = _mirrored(stabilise(capture.planes, capture.noise, scale=scale))
        return unstabilise(_cut(run(stable), capture), capture.noise, scale=scale)

    return restore


def by_kernels(scale: float, network: nn.Module) -> PlaneMethod:
    """Return a network that knows the blur, block by block with the kernels of each place."""

    def restore(capture: LocalCapture) -> FloatArray:
        bank = BlockBank(
            capture.psf,
            _block_network(scale, network, capture),
            block_px=BLOCK_PX,
            overlap_px=OVERLAP_PX,
        )
        return bank.restore_array(capture.planes)

    return restore


def _block_network(scale: float, network: nn.Module, capture: LocalCapture) -> BlockFilter:
    shot, read = (
        torch.tensor(values)[None] for values in (capture.noise.shot, capture.noise.read_variance)
    )

    def restore(block: Block) -> FloatArray:
        blurred = Blurred(
            planes=torch.from_numpy(block.samples)[None],
            otf=torch.from_numpy(block.otf)[None],
            shot=shot,
            read_variance=read,
            scale=scale,
        )
        with torch.no_grad():
            linear: FloatArray = blurred.linear(network(blurred))[0].numpy()
        return linear

    return restore


def onnx_run(model: bytes) -> Run:
    """Return what runs a network in onnxruntime on one thread."""
    engine = NetworkEngine(model, threads=1)
    return lambda planes: engine.run(np.ascontiguousarray(planes)[None])[0]


def _mirrored(planes: NDArray[Any]) -> FloatArray:
    """Return planes with sides of a multiple of `SIDE_PX`, mirrored at the lower right."""
    _, height, width = planes.shape
    return np.pad(planes, ((0, 0), (0, -height % SIDE_PX), (0, -width % SIDE_PX)), mode="reflect")


def _cut(planes: FloatArray, capture: LocalCapture) -> FloatArray:
    _, height, width = capture.planes.shape
    return np.ascontiguousarray(planes[:, :height, :width])
