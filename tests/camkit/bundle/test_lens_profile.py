"""A lens profile in place of kernels: read back as it was, refused where it is none."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camkit.bundle.container import container_from_bytes
from camkit.bundle.manifest import manifest_to_bytes, read_manifest
from camkit.bundle.reader import Bundle, bundle_from_bytes
from camkit.bundle.stages import Illumination, Undistort, Wiener
from camkit.bundle.writer import bundle_to_bytes
from camkit.errors import BundleError
from camkit.radial import RadialIllumination
from tests.bundle_factory import tiny_members, tiny_stages
from tests.profile_bundle import profile_manifest, tiny_profile


def _opened(**changes: Any) -> Bundle:
    data = bundle_to_bytes(profile_manifest(**changes), {})
    return bundle_from_bytes(data, path=Path("plain.camkit"))


def test_a_profile_reads_back_as_distortion_and_illumination() -> None:
    bundle = _opened()
    np.testing.assert_array_equal(bundle.distortion.row(1), [1.02, -0.03, 0, 0, 0.01, 0.004, 0])
    light = bundle.illumination
    assert isinstance(light, RadialIllumination)
    np.testing.assert_array_equal(light.light, [1.0, 0.9, 0.6])
    assert not bundle.manifest.has_kernels
    assert bundle.reference_depth_mm == np.inf


def test_a_lens_without_kernels_says_so() -> None:
    with pytest.raises(BundleError, match=r"plain.camkit has no psf.safetensors"):
        _ = _opened().psf


def test_only_what_is_known_is_asked_for() -> None:
    bundle = _opened(
        optics=tiny_profile(illumination=None),
        stages=tuple(
            stage.model_copy(update={"takes": ("neutral",)}) if stage.type == "undistort" else stage
            for stage in profile_manifest().stages
            if stage.type != "illumination"
        ),
    )
    assert bundle.distortion.radius_mm == 0.35
    with pytest.raises(BundleError, match="states no illumination"):
        _ = bundle.illumination


def _profile(change: Callable[[dict[str, Any]], None]) -> bytes:
    document = json.loads(manifest_to_bytes(profile_manifest()))
    change(document["optics"])
    return json.dumps(document).encode()


REFUSED: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "no number": (
        lambda o: o["distortion"]["coefficients"][0].__setitem__(0, float("nan")),
        "finite number",
    ),
    "an absurd number": (
        lambda o: o["distortion"]["coefficients"][0].__setitem__(0, 1e300),
        "less than or equal",
    ),
    "five odd powers": (lambda o: o["distortion"]["coefficients"][0].append(1.0), "coefficients"),
    "even powers of fewer channels": (
        lambda o: o["distortion"]["even_coefficients"].pop(),
        "even_coefficients needs a row for each of 3; got 2",
    ),
    "no unit": (lambda o: o["distortion"].update(radius_mm=0.0), "radius_mm"),
    "no rows": (
        lambda o: o["distortion"].update(coefficients=[], even_coefficients=[]),
        "at least 1",
    ),
    "no distortion": (lambda o: o.update(distortion=None), "states no distortion"),
    "no illumination": (lambda o: o.update(illumination=None), "states no illumination"),
    "heights that fall": (
        lambda o: o["illumination"].update(heights_mm=[0.0, 0.4, 0.2]),
        "must increase from 0",
    ),
    "heights off the axis": (
        lambda o: o["illumination"].update(heights_mm=[0.1, 0.2, 0.4]),
        "must increase from 0",
    ),
    "light for fewer heights": (
        lambda o: o["illumination"].update(relative_illumination=[1.0, 0.9]),
        "one value for each height",
    ),
    "no light": (
        lambda o: o["illumination"].update(relative_illumination=[1.0, 0.9, 0.0]),
        "greater than",
    ),
    "thousands of heights": (
        lambda o: o["illumination"].update(
            heights_mm=list(range(2000)), relative_illumination=[1.0] * 2000
        ),
        "at most 1024",
    ),
    "a member": (lambda o: o.update(member="psf.safetensors"), "Extra inputs"),
}


@pytest.mark.parametrize(("change", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_a_profile_that_is_none_is_refused(
    change: Callable[[dict[str, Any]], None], message: str
) -> None:
    with pytest.raises(BundleError, match=message):
        read_manifest(_profile(change))


def test_a_profile_needs_the_format_that_brought_it() -> None:
    with pytest.raises(BundleError, match=r"lens profile, which format 2.6 brought, .* states 2.5"):
        _opened(format_version="2.5")


def test_a_profile_of_other_channels_than_the_sensor_is_refused() -> None:
    one = tiny_profile().distortion
    assert one is not None
    rows = {"coefficients": one.coefficients[:1], "even_coefficients": None}
    with pytest.raises(BundleError, match=r"distortion of 1 channel\(s\), the sensor 3"):
        _opened(optics=tiny_profile(distortion=one.model_copy(update=rows)))


def test_kernels_beside_a_profile_are_refused() -> None:
    data = bundle_to_bytes(
        profile_manifest(), {"psf.safetensors": tiny_members()["psf.safetensors"]}
    )
    container_from_bytes(data, what="sound zip")
    with pytest.raises(BundleError, match="its manifest states no such optics"):
        bundle_from_bytes(data, path=Path("hostile.camkit"))


def test_a_bank_is_refused_without_kernels() -> None:
    stages = tiny_stages("network")
    assert {Wiener, Illumination, Undistort} <= {type(stage) for stage in stages}
    with pytest.raises(BundleError, match="needs optics with kernels; a lens_profile has none"):
        profile_manifest(stages=stages)
