"""Pairs of the owner's own script: what it began with and ended with, through the contract.

    input, the owner's picture -> light -> coded by the contract -> network -> light -> compared

The arrays are pictures, not what the network was fed with, so a wrong order, range or curve in the
contract shows. Where they disagree, contracts with one common mistake less are tried.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import permutations
from pathlib import Path
from typing import Any, Final, get_args

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.stages.foreign.pack import CELL_PX, PLACES
from camkit.colorimetry import Matrix
from camkit.errors import ContractError, DecodeError, ParityError
from camkit.export.foreign.contract import SPACES, Affine, Contract, Residual
from camkit.regular_file import check_regular
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.rows import ArrayRows
from camkit.runtime.signal.coding import PlaneCoding
from camkit.runtime.stages.pack import PackedRows
from camkit.runtime.stages.unpack import WovenRows

TOLERANCE: Final = 1e-5
"""Over the largest number of the owner's output, or 1."""
EXPLAINED: Final = 1e-3
"""Largest difference of a contract with one mistake less, for the mistake to be named."""
_MOST: Final = {np.dtype(np.uint8): 255.0, np.dtype(np.uint16): 65535.0}
_KEYS: Final = ("input", "output")
_COLOURS: Final = 3
Run = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """A picture and what the owner's script made of it.

    Attributes:
        picture: (c, h, w) float32; a mosaic has one channel and begins with red.
        result: (c, H, W) float32.
        noise: (1, h, w) float32, the map that the network is given besides; None for none.
    """

    picture: FloatArray
    result: FloatArray
    noise: FloatArray | None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Trial:
    """A way to read pairs.

    Attributes:
        contract: With its residual, which need not be that of the graph.
        baked: Residual that is part of the graph.
        swapped: Where red and blue are swapped: input, output, or both in words.
    """

    contract: Contract
    baked: Residual
    swapped: str = ""


def read_pairs(path: Path) -> tuple[Pair, ...]:
    """Read pairs: `input` and `output`, (c, h, w) or (n, c, h, w); (h, w) for a mosaic.

    Whole numbers of 8 and 16 bits become 0 to 1. `noise` is a map of the noise, in the numbers of
    the network. Mosaics begin with red (RGGB).

    Raises:
        DecodeError: If the file is no such .npz.
    """
    try:
        check_regular(path)
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except OSError as error:
        raise DecodeError(f"cannot read the pairs {path}: {error.strerror or error}") from error
    except (ValueError, EOFError) as error:
        raise DecodeError(f"{path} is no .npz of plain arrays") from error
    if missing := [key for key in _KEYS if key not in arrays]:
        have = ", ".join(arrays) or "nothing"
        raise DecodeError(f"{path} lacks {' and '.join(missing)}; it holds {have}")
    picture, result = (_stack(arrays[key], key) for key in _KEYS)
    if len(picture) != len(result):
        raise DecodeError(f"{path}: {len(picture)} inputs and {len(result)} outputs make no pairs")
    noise: list[FloatArray | None] = [None] * len(picture)
    if "noise" in arrays:
        noise = list(_stack(arrays["noise"], "noise"))
    if len(noise) != len(picture):
        raise DecodeError(f"{path}: {len(noise)} maps of the noise for {len(picture)} pictures")
    return tuple(
        Pair(picture=a, result=b, noise=n) for a, b, n in zip(picture, result, noise, strict=True)
    )


def _stack(array: NDArray[Any], name: str) -> FloatArray:
    values = array.astype(np.float32) / np.float32(_MOST.get(array.dtype, 1.0))
    if values.ndim == 2:
        values = values[None, None]
    if values.ndim == 3 and values.shape[-1] in (1, 3) and values.shape[0] > 4:
        values = np.moveaxis(values, -1, 0)
    if values.ndim == 3:
        values = values[None]
    if values.ndim != 4 or not np.isfinite(values).all():
        raise DecodeError(f"{name} must be finite (c, h, w) or (n, c, h, w); got {array.shape}")
    return np.ascontiguousarray(values)


def prove_pairs(
    pairs: tuple[Pair, ...],
    contract: Contract,
    data: bytes,
    *,
    matrix: Matrix,
    scale: int,
    stride_px: int,
) -> float:
    """Compare what the contract makes of the owner's pictures with what the owner made of them.

    Args:
        pairs: Of the owner.
        contract: Of the network.
        data: Its graph, residual included.
        matrix: (3, 3) from the camera's colours to linear Rec.709.
        scale: Of the graph.
        stride_px: Of the graph; sides are cut to it.

    Returns:
        The largest |difference| over max(1, the largest |output|).

    Raises:
        ParityError: If it exceeds 1e-5; names the mistake that would explain it.
        ContractError: If the arrays do not fit the contract.
    """
    engine = NetworkEngine(data, threads=1, scale=scale)

    def worst(trial: _Trial) -> float:
        return max(_difference(pair, trial, engine.run, matrix, stride_px) for pair in pairs)

    usual = _Trial(contract=contract, baked=contract.residual)
    difference = worst(usual)
    if difference <= TOLERANCE:
        return difference
    reasons = [reason for reason, trial in _mistakes(usual) if worst(trial) <= EXPLAINED]
    reasons.sort(key=lambda reason: "proof.space" not in reason)
    choice = "; which is true, only who made the pairs knows" if len(reasons) > 1 else ""
    hint = (
        f"They agree {', or '.join(dict.fromkeys(reasons))}{choice}"
        if reasons
        else "None of the common mistakes explains it (R and B, order of a cell, range, curve, "
        "residual, space of the pairs); two at once are not tried"
    )
    raise ParityError(
        f"the owner's pairs differ by {difference:.3g} of full scale through the contract, allowed "
        f"{TOLERANCE:g}. {hint}"
    )


def _mistakes(usual: _Trial) -> Iterator[tuple[str, _Trial]]:
    """Yield common mistakes: how the pairs would agree, and the way to read them then."""
    contract = usual.contract
    for what in ("input and output", "input", "output"):
        yield f"with R and B of {what} swapped", replace(usual, swapped=what)
    for reason, changes in _changes(contract):
        yield f"with {reason}", replace(usual, contract=replace(contract, **changes))


def _changes(contract: Contract) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield changes of a contract, one common mistake each."""
    ends = {
        "[0, 255]": Affine(gain=(255.0,)),
        "[0, 1]": Affine(),
        "[-1, 1]": Affine(gain=(2.0,), offset=(-1.0,)),
    }
    for text, numbers in ends.items():
        yield f"range = {text}", {"numbers": numbers, "output_numbers": numbers}
        yield f"input.range = {text}", {"numbers": numbers}
        yield f"output.range = {text}", {"output_numbers": numbers}
    for space in (name for name, coding in SPACES.items() if coding is not None):
        if not contract.is_of_mosaic:
            yield f'space = "{space}"', {"space": space, "output_space": space}
        yield f'output.space = "{space}"', {"output_space": space}
        yield f'proof.space = "{space}"', {"pairs_space": space}
    for residual in get_args(Residual):
        if residual != contract.residual:
            yield f'residual = "{residual}"', {"residual": residual}
    if contract.planes == "packed":
        for order in permutations(PLACES):
            order_text = ", ".join(f'"{colour}"' for colour in order)
            yield f"order = [{order_text}]", {"order": order}


def _difference(pair: Pair, trial: _Trial, run: Run, matrix: Matrix, stride_px: int) -> float:
    result = _restored(pair, trial, run, matrix, stride_px)
    height, width = result.shape[1:]
    expected = pair.result[:, :height, :width]
    if expected.shape != result.shape:
        raise ContractError(
            f"the contract makes {result.shape} of a pair's {pair.picture.shape}, its owner made "
            f"{pair.result.shape}"
        )
    largest = max(1.0, float(np.abs(expected).max(initial=0)))
    return float(np.abs(result - expected).max(initial=0)) / largest


def _restored(pair: Pair, trial: _Trial, run: Run, matrix: Matrix, stride_px: int) -> FloatArray:
    """Return what the stages of a contract make of a picture, in the space of the pairs."""
    contract = trial.contract
    light = _light(pair, contract, matrix, stride_px)
    if contract.planes == "packed":
        rows = PackedRows(ArrayRows(light), "RGGB", contract.order)
        cells = rows.read(0, rows.shape[1] - 1)  # without the last ones, which are mirrored
        light = np.ascontiguousarray(cells[:, :, :-1])
    coding = _coding(contract.space, matrix, contract.numbers, contract.exposure)
    planes = np.empty((contract.channels, *light.shape[1:]), np.float32)
    start = 0
    for count in contract.plane_channels:
        end = start + count
        coding.encode(light[start:end], planes[start:end])
        if "input" in trial.swapped:
            planes[start:end] = planes[start:end][::-1].copy()
        start = end
    if contract.noise and pair.noise is not None:
        planes[start:] = pair.noise[:, : light.shape[1], : light.shape[2]]
    last = planes[start - contract.plane_channels[-1] : start]
    result = _with_residual(run(planes[None])[0].copy(), last, trial)
    if "output" in trial.swapped:
        result = result[::-1].copy()
    _coding(contract.output_space, matrix, contract.output_numbers, contract.exposure).decode(
        result
    )
    if result.shape[0] == len(PLACES):
        woven = WovenRows(ArrayRows(result), contract.order)
        result = woven.read(0, woven.shape[1])
    if result.shape[0] == _COLOURS:
        out = np.empty_like(result)
        _coding(contract.pairs_space, matrix).encode(result, out)
        return out
    return result


def _with_residual(result: FloatArray, plane: FloatArray, trial: _Trial) -> FloatArray:
    """Return what a graph with one residual would give with another."""
    residual = trial.contract.residual
    if residual == trial.baked or result.shape != plane.shape:
        return result
    raw = {"none": result, "added": result - plane, "subtracted": plane - result}[trial.baked]
    return {"none": raw, "added": plane + raw, "subtracted": plane - raw}[residual]


def _light(pair: Pair, contract: Contract, matrix: Matrix, stride_px: int) -> FloatArray:
    """Return the light of a picture, cut to whole cells of the network.

    Raises:
        ContractError: If it does not fit the contract.
    """
    step = stride_px * (CELL_PX if contract.planes == "packed" else 1)
    height, width = (side // step * step for side in pair.picture.shape[1:])
    light = pair.picture[:, :height, :width].copy()
    channels = 1 if contract.is_of_mosaic else sum(contract.plane_channels)
    if light.size == 0 or light.shape[0] != channels or (contract.noise and pair.noise is None):
        map_text = " and a map `noise`" if contract.noise else ""
        raise ContractError(
            f'the input of a pair is {pair.picture.shape}; planes = "{contract.planes}" begins '
            f"with {channels} channel(s){map_text}, at least {step} px a side"
        )
    if not contract.is_of_mosaic:
        for start in range(0, channels, _COLOURS):
            _coding(contract.pairs_space, matrix).decode(light[start : start + _COLOURS])
    return light


def _coding(
    space: str, matrix: Matrix, numbers: Affine | None = None, exposure: float = 1.0
) -> PlaneCoding:
    coded = SPACES[space]
    if coded is None:
        raise ContractError(
            "pairs are held against contracts of camera-linear, rec709-linear and srgb; "
            "stabilised planes have no pictures"
        )
    affine = numbers or Affine()
    return PlaneCoding(
        space=coded, matrix=matrix, exposure=exposure, gain=affine.gain, offset=affine.offset
    )
