"""Golden cases of an array: taken by its own twin, made again as any capture is."""

import numpy as np
import pytest

from camkit.bundle.golden import IMAGE, GoldenArrays
from camkit.bundle.manifest import GoldenCase
from camkit.bundle.reader import Bundle
from camkit.errors import ContractError
from camkit.runtime.kinds.spad.golden_captures import GOLDEN
from camkit.runtime.proof.check import check_bundle
from camkit.runtime.proof.golden_run import case_work
from tests.spad_bundle import BINS, HEIGHT, SCALE, WIDTH

SHAPE = (1, SCALE * HEIGHT, SCALE * WIDTH)


def test_cases_are_three_lights_and_a_scan(bundle: Bundle) -> None:
    cases = GOLDEN.cases(bundle)
    assert list(cases) == ["dim", "typical", "bright", "scan"]
    for name, (case, arrays) in cases.items():
        assert case.name == name
        assert arrays.reference.shape == SHAPE
        (product,) = case_work(bundle, case, arrays, "S").products
        assert product == ("depth_m" if name == "scan" else IMAGE)
    assert cases["scan"][1].capture.shape == (BINS, HEIGHT, WIDTH)


def test_what_becomes_of_a_case_is_near_its_reference(bundle: Bundle) -> None:
    for case, arrays in GOLDEN.cases(bundle).values():
        work = case_work(bundle, case, arrays, "S")
        (product,) = work.products
        assert work.shape_of(product) == SHAPE
        found = work.fill(product=product)
        assert work.network_input("upscale").shape == (2, HEIGHT, WIDTH)
        error = np.abs(found - arrays.reference)
        if product == IMAGE and case.name != "dim":
            assert error.mean() < 0.4 * arrays.reference.mean()
        if product == "depth_m":
            assert np.median(error) < 0.004
        with pytest.raises(ContractError, match="there is no product 'frames'; there are"):
            work.fill(product="frames")


def test_the_probe_is_larger_than_a_window(bundle: Bundle) -> None:
    planes = GOLDEN.probe(bundle, "upscale")
    assert planes.shape[0] == 2
    assert min(planes.shape[1:]) > 128


def test_a_bundle_of_photons_passes_its_check(bundle: Bundle) -> None:
    report = check_bundle(bundle.path, run=case_work, left_out=("laws",))
    assert report.passed, report.lines()


def test_a_capture_of_another_array_is_refused(bundle: Bundle) -> None:
    arrays = GoldenArrays(
        capture=np.ones((5, 5), np.uint16), reference=np.ones((1, 20, 20), np.float32)
    )
    case = GoldenCase(name="other", iso=100.0)
    with pytest.raises(ContractError, match="5x5 pixels, the array of bundle tiny-spad 24x16"):
        case_work(bundle, case, arrays, "S")
