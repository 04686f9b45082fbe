"""A frozen PSF survives the file; a damaged file is refused with its reason."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from safetensors.numpy import load, save

from camkit.bundle.psf_file import (
    UNCERTAINTY,
    psf_from_bytes,
    psf_to_bytes,
    read_measurement,
    read_psf,
    write_psf,
)
from camkit.errors import BundleError
from camkit.psf import FrozenPsf, PsfUncertainty, Symmetry, grid_heights_mm
from camkit.radial import RadialDistortion
from tests.bundle_factory import tiny_psf
from tests.focus_bundle import SHIFTS_UM, focus_psf
from tests.psf_factory import grid_psf, streak_kernel, uniform_psf

Tensors = dict[str, NDArray[Any]]


@st.composite
def psfs(draw: st.DrawFn) -> FrozenPsf:
    fields, depths, waves = (draw(st.integers(1, 3)) for _ in range(3))
    symmetry: Symmetry = draw(st.sampled_from(get_args(Symmetry)))
    channels = draw(st.integers(1, 5))
    rows = draw(st.integers(1, 3)) if symmetry == "grid" else 1
    columns, fields = fields, 1 if symmetry == "uniform" else fields * rows
    h, w = (draw(st.sampled_from([1, 3, 7])) for _ in range(2))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    kernels = rng.uniform(0.1, 1, (fields, depths, waves, h, w)).astype(np.float32)
    kernels /= kernels.sum(axis=(-2, -1), keepdims=True)
    near = np.cumsum(rng.uniform(10, 100, depths))
    x_mm, y_mm = (np.cumsum(rng.uniform(0.1, 2, n)) - 2 for n in (columns, rows))
    is_grid = symmetry == "grid"
    return FrozenPsf(
        kernels=kernels,
        field_heights_mm=(
            grid_heights_mm(x_mm, y_mm) if is_grid else np.arange(fields) * rng.uniform(0.5, 2)
        ),
        depths_mm=np.append(near[:-1], np.inf) if draw(st.booleans()) else near,
        wavelengths_um=0.4 + 0.1 * np.arange(waves),
        pixel_pitch_um=float(rng.uniform(1, 10)),
        distortion=RadialDistortion(
            coefficients=rng.normal(size=(channels, 4)), radius_mm=float(rng.uniform(1, 30))
        ),
        relative_illumination=rng.uniform(0.1, 1, fields),
        symmetry=symmetry,
        grid_x_mm=x_mm if is_grid else None,
        grid_y_mm=y_mm if is_grid else None,
    )


@settings(max_examples=40, deadline=None)
@given(psf=psfs())
def test_psf_comes_back_bit_for_bit(psf: FrozenPsf) -> None:
    data = psf_to_bytes(psf)
    back = psf_from_bytes(data)
    np.testing.assert_array_equal(back.kernels, psf.kernels)
    np.testing.assert_array_equal(back.field_heights_mm, psf.field_heights_mm)
    np.testing.assert_array_equal(back.depths_mm, psf.depths_mm)
    np.testing.assert_array_equal(back.wavelengths_um, psf.wavelengths_um)
    np.testing.assert_array_equal(back.distortion.coefficients, psf.distortion.coefficients)
    np.testing.assert_array_equal(back.relative_illumination, psf.relative_illumination)
    assert back.symmetry == psf.symmetry
    for name in ("grid_x_mm", "grid_y_mm"):
        one, other = getattr(back, name), getattr(psf, name)
        assert (one is None) == (other is None)
        np.testing.assert_array_equal(one, other)
    assert back.pixel_pitch_um == psf.pixel_pitch_um
    assert back.distortion.radius_mm == psf.distortion.radius_mm
    assert psf_to_bytes(back) == data


def test_psf_comes_back_from_disk_and_cannot_be_changed(tmp_path: Path) -> None:
    path = tmp_path / "psf.safetensors"
    write_psf(path, tiny_psf())
    psf = read_psf(path)
    with pytest.raises(ValueError, match="read-only"):
        psf.kernels[0] = 0


def test_missing_psf_file_is_a_bundle_error(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match="cannot read the PSF"):
        read_psf(tmp_path / "none.safetensors")


def _set(name: str, index: Any, value: float) -> Callable[[Tensors], None]:
    def change(tensors: Tensors) -> None:
        tensors[name] = tensors[name].copy()
        tensors[name][index] = value

    return change


def _scale(tensors: Tensors) -> None:
    tensors["kernels"] = tensors["kernels"] * np.float32(1.01)


def _negative(tensors: Tensors) -> None:
    kernels = tensors["kernels"].copy()
    kernels[0, 0, 0, 0, :2] = -0.5, kernels[0, 0, 0, 0, :2].sum() + 0.5
    tensors["kernels"] = kernels


def _retype(name: str, dtype: type[np.generic]) -> Callable[[Tensors], None]:
    def change(tensors: Tensors) -> None:
        tensors[name] = tensors[name].astype(dtype)

    return change


def _ascii(text: str) -> NDArray[Any]:
    return np.frombuffer(text.encode(), np.uint8)


REFUSALS: dict[str, tuple[Callable[[Tensors], object], str]] = {
    "NaN": (_set("kernels", (0, 0, 0, 0, 0), np.nan), "NaN or inf"),
    "inf": (_set("kernels", (0, 0, 0, 0, 0), np.inf), "NaN or inf"),
    "negative": (_negative, "negative"),
    "unnormalised": (_scale, "must sum to 1"),
    "even side": (
        lambda t: t.update(kernels=np.full((2, 1, 3, 2, 2), 0.25, np.float32)),
        "must be odd",
    ),
    "float64 kernels": (_retype("kernels", np.float64), "must be float32"),
    "four axes": (lambda t: t.update(kernels=t["kernels"][0]), "must be float32"),
    "empty kernels": (lambda t: t.update(kernels=t["kernels"][:0]), "not empty"),
    "missing tensor": (lambda t: t.pop("depths_mm"), "missing: depths_mm"),
    "unknown tensor": (lambda t: t.update(code=np.ones(1)), "unknown: code"),
    "float32 axis": (_retype("wavelengths_um", np.float32), "wavelengths_um must be float64"),
    "axis of other length": (
        lambda t: t.update(field_heights_mm=np.array([0.0, 0.1, 0.2])),
        "axes have",
    ),
    "axis that falls": (_set("wavelengths_um", 1, 0.1), "must increase"),
    "first field off the axis": (_set("field_heights_mm", 0, 0.1), "first field must be 0"),
    "field of no height": (_set("field_heights_mm", 1, 1e-300), "1e-06 to 1e\\+06 mm from"),
    "field beyond all": (_set("field_heights_mm", 1, np.inf), "1e-06 to 1e\\+06 mm from"),
    "pitch": (_set("pixel_pitch_um", 0, -1.0), "pixel_pitch_um"),
    "dark corner": (_set("relative_illumination", 1, 0.0), "relative illumination"),
    "distortion": (_set("distortion_coefficients", (0, 0), np.nan), "distortion"),
    "distortion radius": (_set("distortion_radius_mm", 0, 0.0), "radius_mm"),
    "distortion shape": (
        lambda t: t.update(distortion_coefficients=np.ones((4, 3))),
        r"shape \(4, 4\)",
    ),
    "distortion of no channel": (
        lambda t: t.update(distortion_coefficients=np.ones((0, 4))),
        "distortion needs",
    ),
    "unknown symmetry": (lambda t: t.update(symmetry=_ascii("mirror")), "symmetry must be one of"),
    "symmetry of another type": (
        lambda t: t.update(symmetry=np.frombuffer(b"uniform", np.int8)),
        "symmetry must be one of",
    ),
    "uniform with two fields": (lambda t: t.update(symmetry=_ascii("uniform")), "has one field"),
    "grid without positions": (
        lambda t: t.update(symmetry=_ascii("grid")),
        "missing: grid_x_mm, grid_y_mm",
    ),
    "positions of no grid": (
        lambda t: t.update(grid_x_mm=np.zeros(1), grid_y_mm=np.zeros(1)),
        "unknown: grid_x_mm, grid_y_mm",
    ),
}


@pytest.mark.parametrize(("change", "message"), REFUSALS.values(), ids=REFUSALS.keys())
def test_psf_that_is_none_is_refused(change: Callable[[Tensors], object], message: str) -> None:
    tensors = load(psf_to_bytes(tiny_psf()))
    change(tensors)
    data = save({name: np.ascontiguousarray(array) for name, array in tensors.items()})
    with pytest.raises(BundleError, match=message):
        psf_from_bytes(data)


GRID_REFUSALS: dict[str, tuple[Callable[[Tensors], object], str]] = {
    "a position too many": (lambda t: t.update(grid_x_mm=np.arange(3.0)), "position for each"),
    "no position": (lambda t: t.update(grid_x_mm=np.empty(0)), "position for each"),
    "positions that fall": (_set("grid_x_mm", 1, -9.0), "must be finite and increase"),
    "positions that are NaN": (_set("grid_y_mm", 0, np.nan), "must be finite and increase"),
    "positions at infinity": (_set("grid_y_mm", 1, np.inf), "must be finite and increase"),
    "heights of other positions": (_set("field_heights_mm", 0, 0.5), "distances of the grid"),
    "float32 positions": (_retype("grid_x_mm", np.float32), "grid_x_mm must be float64"),
    "positions in a table": (
        lambda t: t.update(grid_x_mm=t["grid_x_mm"][None]),
        "grid_x_mm must be float64",
    ),
    "called uniform": (lambda t: t.update(symmetry=_ascii("uniform")), "unknown: grid_x_mm"),
    "called nothing": (lambda t: t.pop("symmetry"), "unknown: grid_x_mm"),
    "called radial": (lambda t: t.update(symmetry=_ascii("radial")), "unknown: grid_x_mm"),
    "kernels of one row": (lambda t: t.update(kernels=t["kernels"][:2]), "axes have"),
}


@pytest.mark.parametrize(("change", "message"), GRID_REFUSALS.values(), ids=GRID_REFUSALS.keys())
def test_grid_that_is_none_is_refused(change: Callable[[Tensors], object], message: str) -> None:
    streaks = np.stack([streak_kernel(turn) for turn in (0, 90, 180, 270)]).reshape(2, 2, 21, 21)
    positions = np.array([-1.0, 1.0])
    tensors = load(psf_to_bytes(grid_psf(streaks, positions, positions)))
    change(tensors)
    data = save({name: np.ascontiguousarray(array) for name, array in tensors.items()})
    with pytest.raises(BundleError, match=message):
        psf_from_bytes(data)


def test_file_of_a_radial_psf_is_that_of_format_1_0() -> None:
    assert "symmetry" not in load(psf_to_bytes(tiny_psf()))
    assert bytes(load(psf_to_bytes(uniform_psf(streak_kernel(0))))["symmetry"]) == b"uniform"


@settings(max_examples=200, deadline=None)
@given(cut=st.integers(0, 1300), junk=st.binary(max_size=40))
def test_truncated_or_padded_file_is_refused(cut: int, junk: bytes) -> None:
    data = psf_to_bytes(tiny_psf())
    with pytest.raises(BundleError):
        psf_from_bytes(data[:cut] + junk)


def test_kernels_of_a_moved_sensor_come_back_bit_for_bit_and_others_keep_their_bytes() -> None:
    moved, plain = focus_psf(), focus_psf(moved=False)
    data = psf_to_bytes(moved)
    back = psf_from_bytes(data)
    assert back.focus_um is not None
    np.testing.assert_array_equal(back.focus_um, SHIFTS_UM)
    np.testing.assert_array_equal(back.focus_kernels, moved.focus_kernels)
    assert psf_to_bytes(back) == data
    assert set(load(psf_to_bytes(plain))) == set(load(data)) - {"focus_um", "focus_kernels"}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"focus_um": None}, "missing: focus_um"),
        ({"focus_kernels": None}, "missing: focus_kernels"),
        ({"focus_um": np.array([-40.0, 40.0], np.float32)}, "focus_um must be float64"),
        ({"focus_um": np.array([-40.0, 0.0])}, "to both sides of 0 and without it"),
        ({"focus_um": np.array([20.0, 40.0])}, "to both sides of 0"),
        ({"focus_um": np.array([40.0, -40.0])}, "must increase"),
        ({"focus_um": np.array([-np.inf, 40.0])}, "must increase"),
        ({"focus_um": np.array([-40.0, 20.0, 40.0])}, "kernels at 3 shifts of focus"),
        ({"focus_kernels": np.zeros((2, 2, 1, 3, 21), np.float32)}, "shift, field, depth"),
        ({"focus_kernels": np.zeros((2, 2, 1, 3, 21, 21), np.float32)}, "must sum to 1"),
        ({"focus_kernels": np.full((2, 2, 1, 3, 21, 21), np.nan, np.float32)}, "NaN or inf"),
        ({"focus_kernels": np.full((2, 2, 1, 3, 21, 21), -1.0, np.float32)}, "negative"),
    ],
)
def test_damaged_kernels_of_a_moved_sensor_are_refused(
    change: dict[str, NDArray[Any] | None], message: str
) -> None:
    tensors = load(psf_to_bytes(focus_psf())) | change
    data = save({name: array for name, array in tensors.items() if array is not None})
    with pytest.raises(BundleError, match=message):
        psf_from_bytes(data)


def test_an_uncertainty_is_for_files_and_refused_in_a_bundle(tmp_path: Path) -> None:
    psf, uncertainty = tiny_psf(), PsfUncertainty(noise=0.02, shift_px=0.1, width=0.03)
    path = tmp_path / "psf.safetensors"
    write_psf(path, psf, uncertainty)
    assert read_measurement(path)[1] == uncertainty
    np.testing.assert_array_equal(read_psf(path).kernels, psf.kernels)
    with pytest.raises(BundleError, match="unknown: uncertainty"):
        psf_from_bytes(path.read_bytes())
    write_psf(path, psf)
    assert read_measurement(path)[1] is None


@pytest.mark.parametrize("numbers", [[0.1, 0.1], [0.1, -1.0, 0.1], [np.nan, 0.1, 0.1]])
def test_a_damaged_uncertainty_is_refused(tmp_path: Path, numbers: list[float]) -> None:
    path = tmp_path / "psf.safetensors"
    path.write_bytes(save(load(psf_to_bytes(tiny_psf())) | {UNCERTAINTY: np.array(numbers)}))
    with pytest.raises(BundleError, match="uncertainty"):
        read_psf(path)
