"""A capture planned and walked: what is known before any row, its products, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.facts import Port
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.stages import Linearise, Network, Repair
from camkit.errors import ContractError
from tests.job_factory import made_mosaic, made_planes, start
from tests.planes_bundle import facts_of, finer_network, planes_sensor, write_planes_bundle

STAGES = ["linearise", "repair", "white_balance", "demosaic", "wiener", "network"]
STAGES += ["raise_clipped", "illumination", "undistort", "color"]


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    """Give a camera whose one network makes a picture and a depth of twice the size."""
    data = finer_network(1, 2, scale=2)
    outputs = [Port(name="clean", channels=1, scale=2), Port(name="far", channels=1, scale=2)]
    facts = facts_of(data, [Port(name="light", channels=1)], outputs)
    stages = (
        Linearise(),
        Repair(),
        Network(takes=("sound",), gives=("clean", "far"), transform="none"),
    )
    return write_planes_bundle(
        tmp_path_factory.mktemp("two"),
        stages,
        sensor=planes_sensor(),
        networks={"restore": (facts, data)},
        products={"image": "clean", "depth": "far"},
    )


def test_everything_is_planned_before_the_first_row(bundle: Bundle) -> None:
    made = start(bundle, made_mosaic())
    windows = made.windows["restore"]
    assert made.record["tiles"] == windows.to_json()
    assert made.record["quality"] == "exact"
    assert made.record["noise"]["source"] == "bundle"
    assert list(made.record["stages"]) == STAGES
    assert (made.size, made.seconds, made.clipped_fraction) == ("M", {}, 0.0)
    assert made.explain() is not None
    assert made.record["estimate"]["peak_mb"] > 220
    assert set(made.seconds) <= {"noise", "scene"}


def test_a_classical_method_plans_no_windows(bundle: Bundle) -> None:
    made = start(bundle, made_mosaic(), method="wiener")
    assert (made.windows, made.size) == ({}, None)
    assert "tiles" not in made.record
    ways = {name: stage["way"] for name, stage in made.record["stages"].items()}
    assert ways == dict.fromkeys(STAGES, "whole") | {"wiener": "wiener", "network": "left out"}


def test_without_a_bundle_nothing_is_planned() -> None:
    made = start(None, made_mosaic())
    assert made.plan is made.size is made.labels is made.explain() is made.job.subject is None
    assert made.windows == {}
    assert "noise" not in made.record
    assert made.products == {"image": "picture"}
    assert made.shape == (3, 64, 96)
    assert made.fill().shape == made.shape


def test_seconds_come_in_the_order_of_the_data(bundle: Bundle) -> None:
    made = start(bundle, made_mosaic(iso=None))
    made.explain()
    made.fill()
    seconds = list(made.seconds)
    order = ["noise", "scene", *STAGES]
    assert seconds == [name for name in order if name in seconds]
    assert {"noise", "scene", "demosaic", "wiener", "network", "color"} <= set(seconds)


def test_every_plane_of_the_manifest_can_be_had(bundle: Bundle) -> None:
    made = start(bundle, made_mosaic())
    for name, plane in bundle.manifest.planes.items():
        rows = made.rows_of(name)
        assert rows.shape == (len(plane.channels), 64, 96)
        assert rows.read(0, 64).dtype == plane.type
    np.testing.assert_array_equal(made.rows_of("picture").read(0, 64), made.fill())
    np.testing.assert_array_equal(made.rows_of("capture").read(3, 9)[0], made.capture.samples[3:9])
    with pytest.raises(ContractError, match="no stage gives the plane 'depth'; there are capture"):
        made.rows_of("depth")


def test_the_input_of_a_network_is_what_its_stage_takes(bundle: Bundle) -> None:
    made = start(bundle, made_mosaic())
    assert made.network_input("restore").shape == (6, 64, 96)
    with pytest.raises(ContractError, match="no stage has a network of the role 'fuse'"):
        made.network_input("fuse")


def test_products_have_their_own_shape_and_are_walked_one_by_one(two: Bundle) -> None:
    capture = made_planes(samples=np.random.default_rng(0).random((1, 64, 96), np.float32))
    made = start(two, capture)
    assert made.products == {"image": "clean", "depth": "far"}
    assert made.shape == made.shape_of("depth") == (1, 128, 192)
    image, depth = made.fill(), made.fill(product="depth")
    assert image.shape == depth.shape == (1, 128, 192)
    assert (image != depth).any()
    with pytest.raises(ContractError, match="no product 'video'; there are depth, image"):
        made.fill(product="video")
    with pytest.raises(ContractError, match="gives a picture in colour"):
        _ = made.color


def test_walking_twice_counts_nothing_twice(two: Bundle) -> None:
    samples = np.random.default_rng(0).integers(300, 310, (1, 64, 96)).astype(np.uint16)
    samples[0, 10, 10], samples[0, 30, 40] = 1023, 0
    capture = made_planes(samples=samples, black_level=np.full(1, 64, "f4"), white_level=1023.0)
    made = start(two, capture)
    made.fill()
    told = made.warnings
    assert told == ("2 dead or invalid pixels were repaired",)
    made.fill(product="depth")
    made.network_input("restore")
    assert made.warnings == told
    assert made.clipped_fraction == 1 / samples.size


def test_a_buffer_of_another_shape_is_refused(two: Bundle) -> None:
    made = start(two, made_planes(samples=np.zeros((1, 64, 96), np.float32)))
    with pytest.raises(ContractError, match=r"float32 \(1, 128, 192\)"):
        made.fill(np.empty((1, 64, 96), np.float32))


def test_develop_as_a_method_is_the_camera_without_its_restoration(
    bundle: Bundle, tmp_path: Path
) -> None:
    from camkit.bundle.writer import write_bundle
    from tests.bundle_factory import tiny_manifest, tiny_members, tiny_stages

    members = tiny_members()
    del members["network_m.onnx"], members["golden.safetensors"]
    stages = tiny_stages("wiener", "network")
    path = tmp_path / "plain.camkit"
    write_bundle(path, tiny_manifest(stages=stages, networks={}, golden=()), members)
    capture = made_mosaic()
    developed = start(bundle, capture, method="develop")
    plain = start(open_bundle(path), capture)
    np.testing.assert_array_equal(developed.fill(), plain.fill())
    assert developed.record["stages"]["wiener"] == {"way": "left out"}
    assert not set(developed.seconds) & {"wiener", "network"}
