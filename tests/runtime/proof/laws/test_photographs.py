"""Laws of photographs, held against cameras that break one of them each."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from camkit.runtime.proof.laws import photographs
from camkit.runtime.proof.laws.darkroom import Exposed
from camkit.runtime.proof.laws.law import Law
from camkit.runtime.twin.exposure import Setting
from camkit.scenes.charts import lamp_chart, patch_chart

Array = NDArray[np.float32]
Camera = Callable[[Array], Array]


@dataclass(frozen=True, kw_only=True)
class Room:
    """A darkroom whose network and front end are functions of the scene."""

    network: Camera
    front: Camera
    isos: tuple[float, float] = (100.0, 6400.0)

    def expose(self, scene: Array, place: str, settings: Sequence[Setting]) -> Iterator[Exposed]:
        for setting in settings:
            truth = scene * np.float32(setting.exposure)
            made, front = self.network(truth.copy()), self.front(truth.copy())
            yield Exposed(truth=truth, network=made, front=front, light=made, front_light=front)


@pytest.fixture(autouse=True, scope="module")
def _scenes_are_drawn_once() -> Iterator[None]:
    drawn = photographs.procedural_scene
    photographs.procedural_scene = lru_cache(maxsize=8)(drawn)  # type: ignore[assignment]
    yield
    photographs.procedural_scene = drawn


class Ranges:
    """Ranges that nobody asks for."""

    def add(self, _: Any) -> None:
        """Look at nothing."""


def _scene_laws(room: Any) -> tuple[Law, ...]:
    scenes = list(photographs._scenes(room))
    return photographs._better(scenes), photographs._borders(exposed for _, exposed in scenes)


MEASURED: dict[tuple[str, ...], Callable[[Any], tuple[Law, ...]]] = {
    tuple(photographs.DARK): lambda room: photographs._white(room, Ranges()),  # type: ignore[arg-type]
    ("flat",): lambda room: (photographs._flat(room, Ranges()),),  # type: ignore[arg-type]
    ("double",): lambda room: (photographs._double(room),),
    ("better", "borders"): _scene_laws,
}
"""Names of laws -> what measures them."""


def _law(name: str, network: Camera, front: Camera = lambda scene: scene) -> Law:
    (measure,) = (measure for names, measure in MEASURED.items() if name in names)
    laws = {law.name: law for law in measure(Room(network=network, front=front))}
    return laws[name]


def _blurred(scene: Array) -> Array:
    return (scene + np.roll(scene, 1, axis=2) + np.roll(scene, -1, axis=2)) / 3


def _dark_lamps(scene: Array) -> Array:
    return np.where(scene > 5, scene * np.float32(0.01), scene)


def _coloured_lamps(scene: Array) -> Array:
    made = scene.copy()
    made[1][scene[1] > 5] = 0.1
    return made


def _losing_magenta(scene: Array) -> Array:
    magenta = (scene[0] > 2 * scene[1]) & (scene[2] > 2 * scene[1])
    return np.where(magenta, scene * np.float32(0.95), scene)


def _with_gamma(scene: Array) -> Array:
    return np.asarray(np.maximum(scene, 0) ** np.float32(0.97), np.float32)


def _with_a_rim(scene: Array) -> Array:
    made = _blurred(scene)
    made[:, :24] *= np.float32(0.5)
    return made


def test_a_camera_that_gives_the_truth_keeps_every_law() -> None:
    room = Room(network=lambda scene: scene, front=lambda scene: scene)
    laws = [law for measure in MEASURED.values() for law in measure(room)]
    assert {law.name for law in laws} == {name for names in MEASURED for name in names}
    assert all(law.is_kept for law in laws)


@pytest.mark.parametrize(
    ("network", "law"),
    [
        (_dark_lamps, "white_below_half"),
        (_dark_lamps, "white_below_fifth"),
        (_coloured_lamps, "white_below_fifth"),
        (_losing_magenta, "flat"),
        (_with_gamma, "double"),
        (_blurred, "better"),
        (_with_a_rim, "borders"),
    ],
)
def test_a_camera_that_breaks_a_law_is_told_by_it(network: Camera, law: str) -> None:
    found = _law(law, network)
    assert not found.is_kept
    assert ": BROKEN (at most " in found.describe()


def test_a_difference_from_the_front_end_says_so() -> None:
    words = _law("flat", _losing_magenta).describe()
    assert re.match(
        r"flat [\d.]+ % farther from the truth than the front end \([\d.]+ %\): BROKEN "
        r"\(at most 1.00 %, ",
        words,
    )
    worse = _law("better", _blurred)
    assert re.match(r"better [\d.]+ dB below the front end: BROKEN \(at most ", worse.describe())
    gain = replace(worse, worst=-0.5).describe()
    assert gain == "better 0.5 dB above the front end"


def test_a_front_end_that_is_as_bad_excuses_a_network() -> None:
    law = _law("white_below_half", _dark_lamps, _dark_lamps)
    assert law.is_kept
    assert law.front == law.worst > 0.4


def test_one_pixel_more_than_the_front_end_has_is_admitted() -> None:
    """Of a small lamp one pixel is more than 2 %."""

    def with_dark_pixels(count: int) -> Camera:
        def camera(scene: Array) -> Array:
            made = scene.copy()
            y, x = np.nonzero(scene.min(axis=0) > 150)
            made[:, y[:count], x[:count]] = 0.3
            return made

        return camera

    front = with_dark_pixels(40)
    assert _law("white_below_half", with_dark_pixels(41), front).is_kept
    law = _law("white_below_half", with_dark_pixels(42), front)
    assert not law.is_kept
    assert law.excess > 0


def test_the_largest_and_least_light_are_those_of_all_pictures() -> None:
    class Stage:
        most_light = 4.0

    class Bundle:
        class manifest:  # noqa: N801 - as a bundle names it
            @staticmethod
            def stages_of(_: Any) -> tuple[Stage]:
                return (Stage(),)

    ranges = photographs._Ranges(Bundle)  # type: ignore[arg-type]
    light = np.zeros((3, 4, 4), np.float32)
    for low, high in ((-0.01, 2.0), (-0.2, 10.0)):
        made = light.copy()
        made[0, 0, 0], made[0, 0, 1] = low, high
        exposed = Exposed(truth=light, network=made, front=light, light=made, front_light=light)
        ranges.add([exposed])
    below, above = ranges.laws()
    assert (below.worst, below.is_kept) == (pytest.approx(0.2), False)
    assert (above.worst, above.is_kept) == (pytest.approx(10.0), False)


def test_what_is_no_number_breaks_a_law() -> None:
    assert not Law(name="flat", worst=float("nan"), limit=0.01, unit="share").is_kept


def test_charts_hold_lamps_of_every_size_and_patches_of_every_ratio() -> None:
    lamps = lamp_chart()
    assert set(np.unique(lamps.labels)) == set(range(5))
    assert lamps.scene.max() == 200
    patches = patch_chart(0.4)
    assert set(np.unique(patches.labels)) == set(range(28))
    for number in range(1, 28):
        inside = patches.scene[:, patches.labels == number]
        assert np.ptp(inside, axis=1).max() == 0
        assert inside.max() == pytest.approx(0.4)


def test_a_black_picture_breaks_the_law_of_double_light() -> None:
    black = Room(network=np.zeros_like, front=lambda scene: scene)
    assert photographs._double(black).worst == 1.0  # type: ignore[arg-type]
