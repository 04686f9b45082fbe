"""A display that is known comes back from pictures of its grey steps."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.calibration.tone import ToneFacts, levels_of, measure_tone
from camkit.errors import ContractError, DecodeError
from camkit.runtime.metadata import Metadata
from camkit.runtime.output.dng import write_bayer_dng
from tests.dng_factory import grey_tags

TOLERANCE = 0.01
BLACK, WHITE = 256, 4095
ELECTRONS_AT_WHITE = 10_000
LEVELS = (0, 16, 32, 64, 96, 128, 160, 192, 224, 255)
TIMES_S = (2.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.05, 0.05, 0.05)
SHAPE = (160, 240)


@dataclass(frozen=True, slots=True, kw_only=True)
class Display:
    """A display with a power law on a black of its own; the lens dims its corners."""

    black: float = 0.001
    gamma: float = 2.2

    def luminance(self, levels: np.ndarray) -> np.ndarray:
        """Give luminance, 1 at 255."""
        light = self.black + (1 - self.black) * (np.asarray(levels) / 255) ** self.gamma
        return np.asarray(light)


def _codes(light: float, seed: int) -> np.ndarray:
    """Give the 12-bit mosaic of a step; green is a little brighter than red and blue."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(np.float64)
    fall = 1 - 0.4 * ((y / SHAPE[0] - 0.5) ** 2 + (x / SHAPE[1] - 0.5) ** 2)
    seen = light * fall
    seen[::2, ::2] *= 0.6
    seen[1::2, 1::2] *= 0.7
    noise = rng.standard_normal(SHAPE) * np.sqrt(seen / ELECTRONS_AT_WHITE + 1e-7)
    codes = np.rint(BLACK + (seen + noise) * (WHITE - BLACK))
    return np.asarray(np.clip(codes, 0, WHITE), dtype=np.uint16)


def _write(path: Path, codes: np.ndarray, **stated: float) -> Path:
    tags = grey_tags(metadata=Metadata.believable(**stated))
    write_bayer_dng(path, codes, tags=tags)
    return path


def _steps(folder: Path, display: Display, times_s: tuple[float, ...] | None, top: float = 0.7) -> list[Path]:  # noqa: E501 # fmt: skip
    """Write a picture of each level; with times all but the brightest are exposed longer."""
    paths = []
    for number, (level, light) in enumerate(zip(LEVELS, display.luminance(LEVELS), strict=True)):
        factor = 1.0 if times_s is None else times_s[number] / times_s[-1]
        stated = {} if times_s is None else {"exposure_time_s": times_s[number], "iso": 100.0}
        path = folder / f"{level}.dng"
        paths.append(_write(path, _codes(top * light * factor, number), **stated))
    return paths


def _wrong(facts: ToneFacts, display: Display) -> float:
    return float(np.abs(facts.luminance / display.luminance(facts.levels) - 1).max())


def test_longer_exposures_of_dark_steps_give_the_curve_to_one_percent(tmp_path: Path) -> None:
    display = Display()
    facts = measure_tone(_steps(tmp_path, display, TIMES_S), LEVELS)
    assert facts.levels.tolist() == list(LEVELS)
    assert facts.luminance[-1] == 1
    assert _wrong(facts, display) < TOLERANCE
    assert facts.luminance[0] == pytest.approx(display.black, rel=TOLERANCE)
    assert facts.notes == (
        "pictures differ in exposure time; light is scaled by what the files state",
    )
    record = facts.to_record()
    assert record["residual_percent"] < 1
    assert record["gamma"] == pytest.approx(display.gamma, abs=0.02)


def test_one_exposure_for_all_steps_does_where_black_is_bright_enough(tmp_path: Path) -> None:
    display = Display(black=0.02)
    facts = measure_tone(_steps(tmp_path, display, None), LEVELS)
    assert _wrong(facts, display) < TOLERANCE
    assert facts.notes == ("no picture states its exposure time; all are taken as equal",)


def test_the_order_of_the_pictures_does_not_matter(tmp_path: Path) -> None:
    files = _steps(tmp_path, Display(), TIMES_S)
    one, other = measure_tone(files, LEVELS), measure_tone(files[::-1], LEVELS[::-1])
    assert one.to_record() == other.to_record()


def test_iso_and_aperture_scale_as_time_does(tmp_path: Path) -> None:
    files = []
    for number, (light, iso, f_number) in enumerate(
        [(0.01, 800.0, 2.0), (0.1, 400.0, 4.0), (0.6, 100.0, 4.0)]
    ):
        factor = iso / 100 * (4 / f_number) ** 2
        codes = _codes(light * factor, number)
        path = tmp_path / f"{number}.dng"
        files.append(_write(path, codes, iso=iso, f_number=f_number, exposure_time_s=0.1))
    facts = measure_tone(files, (0, 1, 2))
    assert facts.luminance == pytest.approx([1 / 60, 1 / 6, 1], rel=TOLERANCE)
    assert "pictures differ in ISO and f-number" in facts.notes[0]
    assert facts.to_record()["residual_percent"] is None


def test_a_black_without_light_is_kept_and_said(tmp_path: Path) -> None:
    files = _steps(tmp_path, Display(black=0.0), TIMES_S)
    facts = measure_tone(files, LEVELS)
    assert facts.luminance[0] < 1e-4
    assert "0.dng (level 0) does not stand out of the camera's black" in facts.notes[1]
    assert facts.to_record()["residual_percent"] < 1


def test_luminance_never_falls_where_noise_alone_made_it(tmp_path: Path) -> None:
    files = [_write(tmp_path / f"{n}.dng", _codes(0.3, n)) for n in range(5)]
    files.append(_write(tmp_path / "5.dng", _codes(0.6, 5)))
    facts = measure_tone(files, range(6))
    assert (np.diff(facts.luminance) >= 0).all()
    assert facts.luminance[:5] == pytest.approx(0.5, rel=TOLERANCE)


def test_a_display_of_another_kind_is_kept_as_measured_and_shows_in_the_residual(tmp_path: Path) -> None:  # noqa: E501 # fmt: skip
    light = np.array([0.05, 0.1, 0.12, 0.5, 0.55, 0.6])
    files = [_write(tmp_path / f"{n}.dng", _codes(v, n)) for n, v in enumerate(light)]
    facts = measure_tone(files, range(6))
    assert facts.luminance == pytest.approx(light / 0.6, rel=TOLERANCE)
    assert facts.to_record()["residual_percent"] > 10


def test_sequences_that_are_none_are_refused_and_named(tmp_path: Path) -> None:
    files = _steps(tmp_path, Display(), TIMES_S)
    swapped = [*files[:4], files[5], files[4], *files[6:]]
    clipped = _write(tmp_path / "clipped.dng", np.minimum(_codes(1.3, 3), WHITE))
    untold = _write(tmp_path / "untold.dng", _codes(0.7, 4))
    coded = tmp_path / "coded.png"
    assert cv2.imwrite(str(coded), np.full((*SHAPE, 3), 200, np.uint8))
    for last, told in (
        (clipped, r"clipped\.dng: .*of green is clipped; expose less"),
        (untold, r"untold\.dng states no exposure time, as others do"),
        (coded, r"coded\.png is coded in 8 bits"),
    ):
        with pytest.raises(DecodeError, match=told):
            measure_tone([*files[:-1], last], LEVELS)
    with pytest.raises(DecodeError, match=r"96\.dng \(level 128\) is darker than 128\.dng \(level 96\)"):  # noqa: E501 # fmt: skip
        measure_tone(swapped, LEVELS)


def test_steps_that_do_not_differ_are_refused(tmp_path: Path) -> None:
    same = [_write(tmp_path / f"{n}.dng", _codes(0.3, n)) for n in range(3)]
    with pytest.raises(DecodeError, match=r"2\.dng is no brighter than 0\.dng"):
        measure_tone(same, (0, 1, 2))


def test_pictures_of_two_cameras_are_refused(tmp_path: Path) -> None:
    files = [_write(tmp_path / f"{n}.dng", _codes(0.2 * n, n)) for n in (1, 2)]
    files.append(_write(tmp_path / "cut.dng", _codes(0.6, 3)[:, :200]))
    with pytest.raises(DecodeError, match=r"1\.dng is 240x160 RGGB, cut\.dng 200x160 RGGB"):
        measure_tone(files, (0, 1, 2))


def test_too_few_or_repeated_pictures_are_refused(tmp_path: Path) -> None:
    files = _steps(tmp_path, Display(), TIMES_S)
    with pytest.raises(ContractError, match="needs 3 steps; got 2"):
        measure_tone(files[:2], (0, 1))
    with pytest.raises(ContractError, match="given twice"):
        measure_tone([*files[:2], files[0]], (0, 1, 2))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("0,1", "states 2 levels for 3 pictures"),
        ("0,a,2", "takes numbers"),
        ("0,1,", "takes numbers"),
        ("0,-1,2", "must be >= 0"),
        ("0,nan,2", "must be >= 0"),
        ("0,inf,2", "must be >= 0"),
        ("0,1,1", "a level twice"),
    ],
)
def test_levels_that_are_none_are_refused(text: str, told: str) -> None:
    with pytest.raises(ContractError, match=told):
        levels_of(text, 3)


def test_levels_are_read_in_their_order() -> None:
    assert levels_of("0, 16,255.5", 3) == (0.0, 16.0, 255.5)
