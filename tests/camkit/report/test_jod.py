"""JOD: what is shown to `cvvdp`, on which display, and what is said where it is not there."""

import importlib
import sys
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from camkit.errors import UnsupportedError
from camkit.report import jod as module
from camkit.report.jod import jod, obstacle
from tests.hdr_pictures import hdr_pair

OF_CVVDP = {39.0625: 5.852, 100.0: 5.955}
"""cd/m^2 of white -> JOD of `hdr_pair`, computed by cvvdp 0.5.7."""


@pytest.fixture(autouse=True)
def _fresh() -> Iterator[None]:
    """Let no test see a package that another one put there."""
    caches = (module.obstacle, module._metric)  # they outlive a test
    for cached in caches:
        cached.cache_clear()
    yield
    for cached in caches:
        cached.cache_clear()


def fail_with(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(name: str) -> Any:
        assert name == "pycvvdp"
        raise error

    monkeypatch.setattr(importlib, "import_module", refuse)


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (ModuleNotFoundError("no", name="pycvvdp"), r"pip install 'camkit\[hdrvdp\]'"),
        (ModuleNotFoundError("no", name="einops"), "cvvdp lacks einops"),
        (RuntimeError("operator nms\ndoes not exist"), "operator nms does not exist.*same index"),
        (OSError("no libcudart"), "no libcudart"),
    ],
)
def test_a_package_that_is_not_there_or_does_not_load_is_told(
    error: Exception, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    fail_with(error, monkeypatch)
    reason = obstacle()
    assert reason is not None
    with pytest.raises(UnsupportedError, match=words) as told:
        jod(*hdr_pair(), 100.0)
    assert str(told.value) == reason
    assert "\n" not in reason


def test_pictures_are_shown_at_their_luminance_on_the_stated_display(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("torch")
    seen: dict[str, Any] = {}

    class Metric:
        def __init__(self, **settings: Any) -> None:
            seen["settings"] = settings

        def predict(self, test: Any, reference: Any, dim_order: str) -> tuple[float, None]:
            seen["shown"] = test.numpy(), reference.numpy(), dim_order
            return 7.5, None

    def keep(name: str) -> Any:
        return lambda *values, **named: seen.setdefault(name, (values, named))

    fake = SimpleNamespace(
        cvvdp=Metric,
        vvdp_display_photo_eotf=keep("light"),
        vvdp_display_geometry=keep("place"),
    )
    monkeypatch.setitem(sys.modules, "pycvvdp", fake)  # type: ignore[arg-type]
    assert obstacle() is None
    result, truth = hdr_pair()
    assert jod(result, truth, 100.0) == 7.5
    test, reference, order = seen["shown"]
    assert (order, test.dtype) == ("CHW", np.float32)
    np.testing.assert_allclose(test, result * 100)
    np.testing.assert_allclose(reference, truth * 100)
    (peak,), light = seen["light"]
    assert (peak, peak / light["contrast"]) == (10_000, 0.005)
    assert light["source_colorspace"] == "BT.709-linear"
    assert seen["place"] == (((512, 512),), {"distance_m": 1.0, "diagonal_size_inches": 24.0})


@pytest.mark.parametrize("nits_per_unit", OF_CVVDP)
def test_jod_falls_with_the_error_where_cvvdp_is_installed(nits_per_unit: float) -> None:
    if (reason := obstacle()) is not None:
        pytest.skip(reason)
    result, truth = hdr_pair()
    assert jod(truth, truth, nits_per_unit) == pytest.approx(10)
    assert jod(result, truth, nits_per_unit) == pytest.approx(OF_CVVDP[nits_per_unit], abs=0.01)
    assert 7 < jod((result + 3 * truth) / 4, truth, nits_per_unit) < 10
