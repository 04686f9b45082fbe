"""A bundle proves its coarse band on the whole sensor; another haze is found out."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from safetensors.numpy import load, save

from camkit.bundle.haze_golden import (
    HazeGolden,
    haze_golden_from_bytes,
    haze_golden_to_bytes,
)
from camkit.bundle.optics import HAZE
from camkit.bundle.reader import HAZE_GOLDEN, Bundle, open_bundle
from camkit.bundle.writer import write_bundle
from camkit.errors import BundleError, ParityError
from camkit.runtime.proof.check import check_bundle
from camkit.runtime.proof.golden_run import case_work
from camkit.runtime.proof.haze_band import make_haze_golden, prove_haze
from tests.bundle_factory import tiny_manifest, tiny_members
from tests.haze_bundle import hazy_manifest, hazy_optics, write_hazy_bundle
from tests.haze_factory import tiny_haze

Tensors = dict[str, NDArray[Any]]


@pytest.fixture(scope="module")
def golden(tmp_path_factory: pytest.TempPathFactory) -> HazeGolden:
    return make_haze_golden(write_hazy_bundle(tmp_path_factory.mktemp("bare")), "procedural:3")


def _with(folder: Path, data: bytes, **members: bytes) -> Bundle:
    path = folder / "proved.camkit"
    given = hazy_optics().members | {HAZE_GOLDEN: data}
    write_bundle(
        path, hazy_manifest(), given | {k.replace("_", "."): v for k, v in members.items()}
    )
    return open_bundle(path)


def test_a_bundle_proves_its_coarse_band(tmp_path: Path, golden: HazeGolden) -> None:
    bundle = _with(tmp_path, haze_golden_to_bytes(golden))
    report = check_bundle(bundle.path, run=case_work)
    assert report.passed
    said = "\n".join(report.lines())
    assert "the haze of 12 x 8 cells, off by" in said
    assert prove_haze(write_hazy_bundle(tmp_path)) is None


def test_another_haze_is_found_out(tmp_path: Path, golden: HazeGolden) -> None:
    from camkit.bundle.haze_file import haze_to_bytes

    other = haze_to_bytes(tiny_haze(share=0.6))
    path = tmp_path / "other.camkit"
    members = hazy_optics().members | {HAZE_GOLDEN: haze_golden_to_bytes(golden), HAZE: other}
    write_bundle(path, hazy_manifest(), members)
    with pytest.raises(ParityError, match="the haze: picture differs from the stored one by"):
        prove_haze(open_bundle(path))


def test_the_case_comes_back_in_half_precision(golden: HazeGolden) -> None:
    data = haze_golden_to_bytes(golden)
    back = haze_golden_from_bytes(data, what="x")
    np.testing.assert_array_equal(back.cells, golden.cells)
    np.testing.assert_allclose(back.picture, golden.picture, rtol=1e-3, atol=1e-3)
    assert haze_golden_to_bytes(back) == data


DAMAGED: dict[str, tuple[Callable[[Tensors], Any], str]] = {
    "a tensor less": (lambda t: t.pop("gain"), "must hold cells, picture, gain; got cells, pic"),
    "another type": (lambda t: t.update(gain=t["gain"].astype("f4")), "gain must be float16"),
    "another shape": (lambda t: t.update(gain=t["gain"][:, 1:]), "of one shape"),
    "NaN": (lambda t: t.update(gain=np.full_like(t["gain"], np.nan)), "holds NaN or inf"),
    "too large": (
        lambda t: t.update({name: np.zeros((1, 1, 1025), np.float16) for name in t}),
        "at most 1024 a side",
    ),
}


@pytest.mark.parametrize(("change", "said"), DAMAGED.values(), ids=DAMAGED.keys())
def test_a_damaged_case_is_refused(
    golden: HazeGolden, change: Callable[[Tensors], Any], said: str
) -> None:
    tensors = load(haze_golden_to_bytes(golden))
    change(tensors)
    data = save({name: np.ascontiguousarray(array) for name, array in tensors.items()})
    with pytest.raises(BundleError, match=said):
        haze_golden_from_bytes(data, what="x")


def test_a_case_of_another_sensor_is_refused(tmp_path: Path, golden: HazeGolden) -> None:
    cut = HazeGolden(**{n: getattr(golden, n)[:, 1:] for n in ("cells", "picture", "gain")})
    bundle = _with(tmp_path, haze_golden_to_bytes(cut))
    with pytest.raises(BundleError, match=r"has cells \(3, 7, 12\), the sensor \(3, 8, 12\)"):
        prove_haze(bundle)


def test_a_case_without_a_stage_is_refused(tmp_path: Path, golden: HazeGolden) -> None:
    path = tmp_path / "plain.camkit"
    members = tiny_members() | {HAZE_GOLDEN: haze_golden_to_bytes(golden)}
    write_bundle(path, tiny_manifest(), members)
    with pytest.raises(BundleError, match="no stage haze that it would prove"):
        prove_haze(open_bundle(path))
