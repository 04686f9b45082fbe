"""Streak optics survive the file; a damaged file is refused with its reason."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from safetensors.numpy import load, save

from camkit.bundle.streak_file import (
    AXES,
    LIGHT,
    read_streaks,
    streaks_from_bytes,
    streaks_to_bytes,
    write_streaks,
)
from camkit.errors import BundleError
from camkit.streaks import StreakOptics
from tests.streak_factory import small_streaks

Tensors = dict[str, NDArray[Any]]


@st.composite
def optics(draw: st.DrawFn) -> StreakOptics:
    depths, waves, arms = (draw(st.integers(1, 3)) for _ in range(3))
    core = draw(st.sampled_from([1, 3, 33]))
    section, haze = (draw(st.sampled_from([1, 5])) for _ in range(2))
    reach = draw(st.integers(core // 2 + 1, 40))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    lead = (depths, waves)

    def light(*shape: int, sum_over: int = 1) -> NDArray[np.float32]:
        return (rng.uniform(0.1, 0.9, shape) / sum_over).astype(np.float32)

    near = np.cumsum(rng.uniform(10, 100, depths))
    return StreakOptics(
        core=light(*lead, core, core, sum_over=core**2),
        bare_core=light(*lead, core, core, sum_over=core**2),
        profiles=light(*lead, arms, reach + 1),
        sections=light(waves, arms, section),
        angles_rad=rng.uniform(-9, 9, arms),
        haze=light(*lead, haze, haze),
        depths_mm=np.append(near[:-1], np.inf) if draw(st.booleans()) else near,
        wavelengths_um=0.4 + 0.1 * np.arange(waves),
        pixel_pitch_um=float(rng.uniform(1, 10)),
    )


@settings(max_examples=40, deadline=None)
@given(streaks=optics())
def test_streaks_come_back_bit_for_bit(streaks: StreakOptics) -> None:
    data = streaks_to_bytes(streaks)
    back = streaks_from_bytes(data)
    for name in (*LIGHT, *AXES):
        np.testing.assert_array_equal(getattr(back, name), getattr(streaks, name))
    assert back.pixel_pitch_um == streaks.pixel_pitch_um
    assert streaks_to_bytes(back) == data


def test_streaks_come_back_from_disk_and_cannot_be_changed(tmp_path: Path) -> None:
    path = tmp_path / "streaks.safetensors"
    write_streaks(path, small_streaks())
    streaks = read_streaks(path)
    np.testing.assert_array_equal(streaks.dense(), small_streaks().dense())
    with pytest.raises(ValueError, match="read-only"):
        streaks.core[0] = 0


def test_missing_file_is_a_bundle_error(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match=r"cannot read the streaks .*none"):
        read_streaks(tmp_path / "none.safetensors")


def _set(name: str, index: Any, value: float) -> Callable[[Tensors], None]:
    def change(tensors: Tensors) -> None:
        tensors[name] = tensors[name].copy()
        tensors[name][index] = value

    return change


def _retype(name: str, dtype: type[np.generic]) -> Callable[[Tensors], None]:
    def change(tensors: Tensors) -> None:
        tensors[name] = tensors[name].astype(dtype)

    return change


def _cut(name: str, part: Any) -> Callable[[Tensors], None]:
    def change(tensors: Tensors) -> None:
        tensors[name] = tensors[name][part]

    return change


REFUSALS: dict[str, tuple[Callable[[Tensors], object], str]] = {
    **{f"no {name}": (lambda t, n=name: t.pop(n), f"missing: {name}") for name in (*LIGHT, *AXES)},  # type: ignore[misc]
    "no pitch": (lambda t: t.pop("pixel_pitch_um"), "missing: pixel_pitch_um; unknown: none"),
    "unknown tensor": (lambda t: t.update(code=np.ones(1)), "missing: none; unknown: code"),
    **{
        f"NaN in {name}": (_set(name, (0,) * rank, math.nan), f"refused: .*{name} must be finite")
        for name, rank in (("core", 4), ("bare_core", 4), ("profiles", 4), ("sections", 3))
    },
    "inf haze": (_set("haze", (0, 0, 0, 0), math.inf), "refused: .*haze must be finite"),
    "negative": (_set("profiles", (0, 0, 1, 3), -1e-6), "refused: .*profiles must be finite"),
    "more than all the light": (_set("profiles", (0, 0, 1, 3), 3e38), "refused: .*more than all"),
    "NaN angle": (_set("angles_rad", 0, math.nan), "finite angles"),
    "NaN depth": (_set("depths_mm", 0, math.nan), "depths_mm must be > 0"),
    "negative pitch": (_set("pixel_pitch_um", 0, -1.0), "pixel_pitch_um must be > 0"),
    "two pitches": (
        lambda t: t.update(pixel_pitch_um=np.ones(2)),
        r"pixel_pitch_um must be one number; got \(2,\)",
    ),
    "float64 core": (_retype("core", np.float64), "core must be float32 with 4 axes"),
    "float16 haze": (_retype("haze", np.float16), "haze must be float32"),
    "float32 angles": (_retype("angles_rad", np.float32), "angles_rad must be float64"),
    "integers": (_retype("angles_rad", np.int64), "angles_rad must be float64"),
    "three axes": (_cut("profiles", 0), "profiles must be float32 with 4 axes"),
    "a table of angles": (_cut("angles_rad", np.s_[None]), "angles_rad must be float64 with 1"),
    "empty core": (_cut("core", np.s_[..., :0]), "core must be .*not empty"),
    "empty axis": (_cut("wavelengths_um", np.s_[:0]), "wavelengths_um must be .*not empty"),
    "even core": (
        lambda t: t.update(core=t["core"][..., 1:, 1:], bare_core=t["bare_core"][..., 1:, 1:]),
        "core need an odd number",
    ),
    "cores of two sides": (_cut("bare_core", np.s_[..., 1:4, 1:4]), "bare_core must be"),
    "an arm too few": (_cut("sections", np.s_[:, 1:]), "sections must be"),
    "a depth too many": (
        lambda t: t.update(depths_mm=np.array([1.0, 2.0, 3.0])),
        r"core must be \(3, 2, 5, 5\)",
    ),
    "a core of 35 px": (
        lambda t: t.update(core=np.zeros((2, 2, 35, 35), "f4"), bare_core=t["core"]),
        "refused: .*must be",
    ),
}


@pytest.mark.parametrize(("change", "message"), REFUSALS.values(), ids=REFUSALS.keys())
def test_streaks_that_are_none_are_refused(
    change: Callable[[Tensors], object], message: str
) -> None:
    tensors = load(streaks_to_bytes(small_streaks()))
    change(tensors)
    data = save({name: np.ascontiguousarray(array) for name, array in tensors.items()})
    with pytest.raises(BundleError, match=message) as told:
        streaks_from_bytes(data, what="this.safetensors")
    assert str(told.value).startswith("this.safetensors")
    assert "\n" not in str(told.value)


GOOD = streaks_to_bytes(small_streaks())


@settings(max_examples=100, deadline=None)
@given(cut=st.integers(0, len(GOOD) - 1), junk=st.binary(max_size=40))
def test_truncated_or_padded_file_is_refused(cut: int, junk: bytes) -> None:
    assume(len(junk) != len(GOOD) - cut)  # else bytes are changed, see below
    with pytest.raises(BundleError):
        streaks_from_bytes(GOOD[:cut] + junk)


@settings(max_examples=200, deadline=None)
@given(position=st.integers(0, len(GOOD) - 1), value=st.integers(0, 255))
def test_a_changed_byte_is_harmless_or_a_bundle_error(position: int, value: int) -> None:
    """What opens makes kernels that are finite and not below 0."""
    data = bytearray(GOOD)
    data[position] = value
    try:
        streaks = streaks_from_bytes(bytes(data))
    except BundleError:
        return
    dense = streaks.dense()
    assert np.isfinite(dense).all()
    assert (dense >= 0).all()
