"""Check that a capture lies in the ranges in which its bundle was shown to help.

    capture -> what can be seen of it beforehand -> compared with the manifest's `envelope`

`camkit stress --write` measures the ranges with the same functions, so that both sides mean the
same. Every quantity is that of the sensor signal: before white balance, 1.0 = white level.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.manifest import Range
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.noise import NoiseModel
from camkit.runtime.capture import Capture
from camkit.runtime.options import OnUnsafe
from camkit.runtime.signal.noise import REPAIR_MARGIN_PX, repair_mosaic, repair_planes

GREY: Final = 0.18
SAMPLE_BANDS: Final = 32
SAMPLE_ROWS: Final = 12
"""A capture is looked at in this many bands of so many rows, spread over its height."""
QUANTITIES: Final = {
    "grey_noise": "standard deviation of the noise at a signal of 0.18, white = 1",
    "signal_level": "mean signal, white = 1",
    "clipped_fraction": "share of clipped samples, 0 to 1",
    "broken_fraction": "share of dead and invalid samples, 0 to 1",
    "bit_depth": "bits between black and white level",
    "side_px": "shorter side in pixels",
}
"""Names of the envelope, in the order in which they are reported."""
OPEN_LOW: Final = 0.0
OPEN_HIGH: Final = 1e9
"""Ends that nothing bounds; the manifest takes no infinity."""


def grey_noise(noise: NoiseModel) -> float:
    """Return the standard deviation at mid grey, before white balance; green's of three colours."""
    middle = len(noise.shot) // 2
    return float(np.sqrt(noise.shot[middle] * GREY + noise.read_variance[middle]))


def observe(capture: Capture, noise: NoiseModel) -> dict[str, float]:
    """Measure what can be seen of a capture before it is processed.

    Args:
        capture: A mosaic or planes.
        noise: Its noise before white balance.

    Returns:
        Name -> value of `QUANTITIES`; a float capture has no `bit_depth`.
    """
    conditions = {
        "grey_noise": grey_noise(noise),
        "side_px": float(min(capture.height, capture.width)),
    }
    conditions |= _sampled(capture)
    if np.issubdtype(capture.samples.dtype, np.integer):
        span = capture.white_level - float(capture.black_level.max())
        conditions["bit_depth"] = float(np.log2(span + 1))
    return {name: conditions[name] for name in QUANTITIES if name in conditions}


def _sampled(capture: Capture) -> dict[str, float]:
    """Return the quantities that need samples, from bands over the whole height."""
    total = clipped = broken = 0
    signal = 0.0
    for top, bottom in _bands(capture.height):
        above, below = (
            max(top - REPAIR_MARGIN_PX, 0),
            min(bottom + REPAIR_MARGIN_PX, capture.height),
        )
        inside = slice(top - above, bottom - above)
        rows, mask = _repair(capture, capture.linear_rows(above, below))
        signal += float(np.maximum(rows[..., inside, :], 0).sum(dtype=np.float64))
        broken += int(np.count_nonzero(mask[..., inside, :]))
        clipped += int(np.count_nonzero(capture.saturated_rows(top, bottom)))
        total += mask[..., inside, :].size
    return {
        "signal_level": signal / total,
        "clipped_fraction": clipped / total,
        "broken_fraction": broken / total,
    }


def _bands(height: int) -> list[tuple[int, int]]:
    """Return first and last rows of the bands; all rows of a small capture."""
    count = min(SAMPLE_BANDS, -(-height // SAMPLE_ROWS))
    starts = np.linspace(0, max(height - SAMPLE_ROWS, 0), count)
    # Even, so that every band holds as many rows of each colour.
    return [(int(s) // 2 * 2, min(int(s) // 2 * 2 + SAMPLE_ROWS, height)) for s in starts]


def _repair(capture: Capture, rows: FloatArray) -> tuple[FloatArray, np.ndarray]:
    return repair_planes(rows) if capture.cfa is None else repair_mosaic(rows)


def findings(envelope: Mapping[str, Range], conditions: Mapping[str, float]) -> tuple[str, ...]:
    """Return the properties of a capture that lie outside.

    Args:
        envelope: The manifest's ranges; names that this version does not know are passed over.
        conditions: From `observe`.

    Returns:
        One phrase per quantity outside its range, in the order of `QUANTITIES`.
    """
    return tuple(
        f"{meaning} ({name}) is {conditions[name]:.3g}, outside {envelope[name].low:.3g} to "
        f"{envelope[name].high:.3g}"
        for name, meaning in QUANTITIES.items()
        if name in envelope
        and name in conditions
        and not envelope[name].low <= conditions[name] <= envelope[name].high
    )


def verdict(outside: tuple[str, ...], bundle: str, on_unsafe: OnUnsafe) -> str | None:
    """Return the warning of findings.

    Args:
        outside: From `findings`.
        bundle: Name for the message.
        on_unsafe: What the caller wants done.

    Returns:
        The warning; None if nothing was found.

    Raises:
        ContractError: If something was found and the caller wants that to fail.
    """
    if not outside:
        return None
    text = f"outside the measured range of bundle {bundle}: {'; '.join(outside)}"
    if on_unsafe == "fail":
        raise ContractError(
            f"{text}; use {option_text('on_unsafe', 'warn')} or fallback, or another "
            f"{option_text('bundle')}"
        )
    if on_unsafe == "fallback":
        return f"{text}; the network is left out and its input is used instead"
    fallback = option_text("on_unsafe", "fallback")
    return f"{text}; the network may harm the picture, and {fallback} leaves it out"
