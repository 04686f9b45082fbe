"""The laws of photographs: what holds for any scene, camera and network.

white    what is white stays white: lamps of four sizes and strengths
flat     an even area keeps its light, in 27 colours, three levels, two ISOs, three places
double   twice the exposure gives twice the light, in 19 of 20 blocks
better   no network is worse than its front end, in any zone
range    no light below black or beyond the bound
borders  the rim of a picture is like its middle
"""

from collections.abc import Iterable
from itertools import product
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Network
from camkit.colorimetry import encode_srgb
from camkit.runtime.proof.laws.darkroom import PLACES, Darkroom, Exposed, reason_not_judged
from camkit.runtime.proof.laws.law import SHARE, Law
from camkit.runtime.twin.exposure import Setting
from camkit.scenes.charts import lamp_chart, patch_chart
from camkit.scenes.procedural import procedural_scene

LEAST_SIDE_PX: Final = 640
"""A sensor that no chart lies on is not judged."""
DARK: Final = {"white_below_half": (0.5, 0.02), "white_below_fifth": (0.2, 0.005)}
"""Law -> share of white, and how many white pixels may lie below it."""
FLAT: Final = 0.01
LEVELS: Final = (0.4, 0.1, 0.03)
DOUBLE: Final = 0.01
BLOCK_PX: Final = 32
SURE: Final = 0.95
LOWEST: Final = -0.05
BORDERS: Final = 1.5
RIM_PX: Final = 24
ERROR_WORDS: Final = ("farther from the truth than the front end", "nearer to the truth than it")
LOSS_WORDS: Final = ("below the front end", "above the front end")
SCENES: Final = range(5_300_000, 5_300_004)
"""Seeds of procedural scenes that nothing is trained on."""
SIDE_PX: Final = 320
SEED: Final = 1
"""Of the noise of charts."""


def picture_laws(bundle: Bundle, size: str | None, threads: int) -> tuple[Law, ...] | str:
    """Measure the laws of photographs for one size of a bundle's networks.

    Args:
        bundle: The camera.
        size: Of its networks.
        threads: To compute with.

    Returns:
        The laws, or why none can be held.
    """
    reason = reason_not_judged(bundle)
    extent = bundle.manifest.sensor.extent
    if extent is not None and min(extent.width_px, extent.height_px) < LEAST_SIDE_PX:
        reason = reason or f"the sensor is smaller than the charts ({LEAST_SIDE_PX} px)"
    if reason is not None or size is None:
        return reason or "no network"
    room = Darkroom(bundle=bundle, size=size, threads=threads)
    ranges = _Ranges(bundle)
    scenes = list(_scenes(room))
    ranges.add(shot for _, shot in scenes)
    laws = (
        *_white(room, ranges),
        _flat(room, ranges),
        _double(room),
        _better(scenes),
        _borders(shot for _, shot in scenes),
    )
    return (*laws, *ranges.laws())


class _Ranges:
    """The least and largest light of all pictures."""

    def __init__(self, bundle: Bundle) -> None:
        stages = bundle.manifest.stages_of(Network)
        self._most_light = max(stage.most_light for stage in stages)
        self._low = self._front_low = self._times = 0.0

    def add(self, pictures: Iterable[Exposed]) -> None:
        """Add pictures."""
        for picture in pictures:
            self._low = min(self._low, float(picture.light.min()))
            self._front_low = min(self._front_low, float(picture.front_light.min()))
            largest = max(1.0, float(picture.front_light.max()))
            self._times = max(self._times, float(picture.light.max()) / largest)

    def laws(self) -> tuple[Law, Law]:
        """Return the laws."""
        return (
            Law(
                name="below_black", worst=-self._low, limit=-LOWEST, unit="", front=-self._front_low
            ),
            Law(name="above_front_end", worst=self._times, limit=self._most_light, unit="times"),
        )


def _white(room: Darkroom, ranges: _Ranges) -> tuple[Law, ...]:
    """Count what is white in the truth and dark in the picture, by size of lamps.

    As much as the front end has is admitted, and one pixel: of a small lamp that is more than 2 %.
    """
    chart = lamp_chart()
    worst: dict[str, Law] = {}
    for place in ("middle", "corner"):
        (shot,) = room.expose(chart.scene, place, [Setting(iso=room.isos[0], seed=SEED)])
        ranges.add([shot])
        white = shot.truth.min(axis=0) >= 1
        for number, name in enumerate(chart.names, start=1):
            lit = white & (chart.labels == number)
            if not lit.any():
                continue
            for law, (threshold, admitted) in DARK.items():
                dark, front = (
                    int(np.count_nonzero(picture.min(axis=0)[lit] < threshold))
                    for picture in (shot.network, shot.front)
                )
                pixels = int(np.count_nonzero(lit))
                candidate = Law(
                    name=law,
                    worst=dark / pixels,
                    limit=max(admitted, (front + 1) / pixels),
                    unit=SHARE,
                    front=front / pixels,
                    where=f"{name}, {place}",
                )
                if law not in worst or candidate.excess > worst[law].excess:
                    worst[law] = candidate
    return tuple(worst.values())


def _flat(room: Darkroom, ranges: _Ranges) -> Law:
    """Measure how much farther from the truth even areas are than those of the front end."""
    worst = (-1.0, 0.0, "")
    charts = [patch_chart(level) for level in LEVELS]
    labels = charts[0].labels
    inside = [labels == number for number in range(1, len(charts[0].names) + 1)]
    exposures = list(product(charts, room.isos))
    settings = [
        Setting(iso=iso, exposure=level / LEVELS[0], seed=SEED)
        for level, iso in product(LEVELS, room.isos)
    ]
    for place in PLACES:
        shots = room.expose(charts[0].scene, place, settings)
        for (chart, iso), shot in zip(exposures, shots, strict=True):
            ranges.add([shot])
            for where, name in zip(inside, chart.names, strict=True):
                true, network, front = (
                    picture[:, where].mean(axis=1)
                    for picture in (shot.truth, shot.network, shot.front)
                )
                error, front_error = (np.abs(x - true).max() / true.max() for x in (network, front))
                candidate = (
                    float(error - front_error),
                    float(front_error),
                    f"{name}, {place}, ISO {iso:g}",
                )
                worst = max(worst, candidate)
    more, front_error, where = worst
    return Law(
        name="flat",
        worst=max(more, 0.0),
        limit=FLAT,
        unit=SHARE,
        front=front_error,
        where=where,
        beside_front=ERROR_WORDS,
    )


def _double(room: Darkroom) -> Law:
    """Compare the light of blocks at two exposures, without noise."""
    scene = np.clip(procedural_scene(SCENES[0], SIDE_PX, SIDE_PX), 0, 1)
    settings = [Setting(iso=room.isos[0], exposure=share, noise=False) for share in (0.2, 0.4)]
    pair = list(room.expose(scene, "middle", settings))
    network, front = (
        _most_unlike(*(_blocks(getattr(shot, name)) for shot in pair))
        for name in ("light", "front_light")
    )
    return Law(name="double", worst=network, limit=max(DOUBLE, front), unit=SHARE, front=front)


def _most_unlike(once: FloatArray, twice: FloatArray) -> float:
    """Return by how much, of a block's brightest colour, light is not doubled in 19 of 20 blocks.

    The worst block is the darkest, where a filter that follows the power of its block is off by as
    much as a network. A picture that is black all over holds none of its light: 1.
    """
    level = 2 * once.max(axis=0)
    error = np.abs(twice - 2 * once).max(axis=0)
    lit = level > 0.02
    if not lit.any():
        return 1.0
    return float(np.quantile(error[lit] / level[lit], SURE))


def _blocks(light: FloatArray) -> FloatArray:
    channels, height, width = light.shape
    rows, columns = height // BLOCK_PX, width // BLOCK_PX
    whole = light[:, : rows * BLOCK_PX, : columns * BLOCK_PX]
    cut = whole.reshape(channels, rows, BLOCK_PX, columns, BLOCK_PX)
    return np.asarray(cut.mean(axis=(2, 4)))


def _scenes(room: Darkroom) -> Iterable[tuple[str, Exposed]]:
    """Yield drawn scenes in every zone, at the lowest ISO and four stops above."""
    isos = room.isos[0], min(16 * room.isos[0], room.isos[1])
    for seed in SCENES:
        scene = procedural_scene(seed, SIDE_PX, SIDE_PX)
        settings = [Setting(iso=iso, seed=seed) for iso in isos]
        for place in PLACES:
            for shot in room.expose(scene, place, settings):
                yield place, shot


def _better(scenes: list[tuple[str, Exposed]]) -> Law:
    """Compare PSNR with that of the front end, by zone; within a standard error is no loss."""
    worst = (-np.inf, 0.0, "")
    for place in PLACES:
        gains = np.array(
            [
                _psnr(shot.network, shot.truth) - _psnr(shot.front, shot.truth)
                for zone, shot in scenes
                if zone == place
            ]
        )
        error = float(gains.std(ddof=1) / np.sqrt(gains.size))
        worst = max(worst, (float(-gains.mean()), error, place))
    loss, error, where = worst
    return Law(
        name="better", worst=loss, limit=error, unit="dB", where=where, beside_front=LOSS_WORDS
    )


def _psnr(picture: FloatArray, truth: FloatArray) -> float:
    return float(-10 * np.log10(np.mean(np.square(_gap(picture, truth))) + 1e-12))


def _gap(picture: FloatArray, truth: FloatArray) -> FloatArray:
    picture_codes, truth_codes = (encode_srgb(np.clip(x, 0, 1)) for x in (picture, truth))
    return np.asarray(picture_codes - truth_codes, np.float64)


def _borders(pictures: Iterable[Exposed]) -> Law:
    """Compare the error of the rim with that of the middle."""
    sums = np.zeros((2, 2))
    for shot in pictures:
        for row, picture in enumerate((shot.network, shot.front)):
            squared = np.square(_gap(picture, shot.truth)).mean(axis=0)
            middle = squared[RIM_PX:-RIM_PX, RIM_PX:-RIM_PX]
            rim = (squared.sum() - middle.sum()) / (squared.size - middle.size)
            sums[row] += rim, middle.mean()
    network, front = (float(np.sqrt(rim / max(middle, 1e-12))) for rim, middle in sums)
    return Law(name="borders", worst=network, limit=max(BORDERS, front), unit="times", front=front)


LAWS: Final = picture_laws
