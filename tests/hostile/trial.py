"""One hostile bundle put to use: opened, checked at every level, a tiny picture processed.

It may end in two ways: every step succeeds, with a finite and bounded picture, or camkit refuses in
one line. Anything else is a fault of camkit and leaves here as an exception.
"""

from pathlib import Path

import numpy as np

from camkit.bundle.reader import Bundle, open_bundle
from camkit.errors import CamkitError
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.proof.check import check_bundle
from camkit.runtime.proof.golden_run import case_work

HEIGHT_PX, WIDTH_PX = 64, 96
MOST_SCALE = 16
MOST_LINE = 4000


class FaultError(AssertionError):
    """What a bundle must not make camkit do."""


def try_bundle(path: Path) -> str:
    """Put a bundle to use.

    Returns:
        How it ended: "refused", "not proved", "not processed" or "processed".

    Raises:
        FaultError: If a refusal is no single line, a report contradicts the reader, or the picture
            is not finite and bounded. Any other exception than camkit's own passes through.
    """
    report = check_bundle(path, run=case_work)
    for layer in report.layers:
        _check_line(layer.message)
    try:
        bundle = open_bundle(path)
    except CamkitError as error:
        _check_line(str(error))
        if report.passed:
            raise FaultError(f"check passed what does not open: {error}") from error
        return "refused"
    try:
        picture = process(bundle)
    except CamkitError as error:
        _check_line(str(error))
        return "not processed"
    if not np.isfinite(picture).all() or max(picture.shape[1:]) > MOST_SCALE * WIDTH_PX:
        raise FaultError(f"the picture is not finite and bounded: {picture.shape}")
    return "processed" if report.passed else "not proved"


def process(bundle: Bundle) -> np.ndarray:
    """Process noise of the size of the sensor, or a crop of one that is not tiny."""
    sensor = bundle.manifest.sensor
    size, origin_px = (HEIGHT_PX, WIDTH_PX), None
    if sensor.extent is not None:
        whole = sensor.extent.height_px, sensor.extent.width_px
        size = min(size[0], whole[0]), min(size[1], whole[1])
        origin_px = None if size == whole else (0, 0)
    rng = np.random.default_rng(1)
    given: np.ndarray = rng.integers(64, 1000, size, dtype=np.uint16)
    if sensor.type == "planes":
        given = rng.random((len(sensor.channels), *size), dtype=np.float32)
    pipeline = Pipeline(bundle, Options(threads=1))
    return pipeline.process_array(given, iso=100, white_balance=None, origin_px=origin_px)


def _check_line(message: str) -> None:
    if not message.strip() or len(message) > MOST_LINE or len(message.splitlines()) != 1:
        raise FaultError(f"no single line: {message[:400]!r} ({len(message)} characters)")
