"""A network of any ports and scale on the planes of its stage: tiled, guarded, split."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.bundle.facts import Port
from camkit.bundle.manifest import Range
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.stages import Color, Linearise, Network, Wiener
from camkit.bundle.writer import write_bundle
from camkit.errors import ContractError
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.signal.stabilise import stabilise, unstabilise
from camkit.runtime.stages.network import given_rows
from tests.bundle_factory import (
    PITCH_UM,
    tiny_manifest,
    tiny_members,
    tiny_network,
)
from tests.job_factory import made_job, made_mosaic, made_planes, read_all, start, stream_of
from tests.planes_bundle import facts_of, finer_network, planes_sensor, write_planes_bundle
from tests.psf_factory import streak_kernel, uniform_psf

SIZES = {"odd": (61, 95), "whole cells": (64, 96), "one row": (1, 96), "one pixel": (1, 1)}


def _light(channels: int, size: tuple[int, int] = (64, 96), seed: int = 0) -> FloatArray:
    planes = np.random.default_rng(seed).random((channels, *size), dtype=np.float32)
    return np.asarray(0.05 + 0.5 * planes, dtype=np.float32)


def _camera(
    folder: Path, channels: int, outputs: list[int], *, scale: int = 1, **stage: Any
) -> Bundle:
    """Give a camera of one network from its light to planes of some channels each."""
    data = finer_network(channels, sum(outputs), scale=scale)
    ports = [Port(name=f"p{i}", channels=n, scale=scale) for i, n in enumerate(outputs)]
    facts = facts_of(data, [Port(name="light", channels=channels)], ports)
    names = tuple(f"plane{i}" for i in range(len(outputs)))
    stages = (Linearise(gives=("light",)), Network(takes=("light",), gives=names, **stage))
    return write_planes_bundle(
        folder,
        stages,
        sensor=planes_sensor(tuple("abcdefgh")[:channels], size_px=None),
        networks={"restore": (facts, data)},
        products={"image": names[0]} | {name: name for name in names[1:]},
    )


def _whole(camera: Bundle, planes: FloatArray) -> FloatArray:
    """Run the network once over the whole picture, padded by its edge to the stride."""
    facts = camera.network_facts("restore", "M")
    stride, scale = facts.stride_px, facts.output_scale
    _, height, width = planes.shape
    pads = ((0, 0), (0, -height % stride), (0, -width % stride))
    engine = NetworkEngine(camera.network_bytes("restore", "M"), threads=1, scale=scale)
    made = engine.run(np.ascontiguousarray(np.pad(planes, pads, mode="edge"))[None])[0]
    return made[:, : scale * height, : scale * width]


# ------------------------------------------------------------------------------- what it is given


def test_every_plane_is_stabilised_by_the_noise_behind_its_own_gains(bundle: Bundle) -> None:
    entry = bundle.manifest.stage(Network)
    assert entry is not None
    job = made_job(made_mosaic(), bundle)
    first, second = _light(3), _light(3, seed=1)
    taken = [stream_of(first, gains=(1.0, 1.0, 1.0)), stream_of(second, gains=(2.0, 1.0, 1.5))]
    rows = given_rows(entry, job, taken)
    wanted = [
        stabilise(planes, job.noise.with_gains(stream.gains), scale=entry.scale)
        for planes, stream in zip((first, second), taken, strict=True)
    ]
    np.testing.assert_array_equal(read_all(rows, 7), np.concatenate(wanted))


def test_without_a_transform_planes_are_given_as_they_are(bundle: Bundle) -> None:
    job = made_job(made_mosaic(), bundle)
    entry = Network(transform="none")
    taken = [stream_of(_light(n, seed=n)) for n in (1, 4, 2)]
    rows = given_rows(entry, job, taken)
    np.testing.assert_array_equal(
        read_all(rows, 7), np.concatenate([_light(n, seed=n) for n in (1, 4, 2)])
    )


def test_the_input_of_the_whole_capture_is_what_the_rows_are(bundle: Bundle) -> None:
    made = start(bundle, made_mosaic())
    entry = bundle.manifest.stage(Network)
    assert entry is not None
    planes = [read_all(made.rows_of(name)) for name in entry.takes]
    noise = made.job.noise.with_gains(made.white_balance)
    wanted = np.concatenate([stabilise(p, noise, scale=entry.scale) for p in planes])
    np.testing.assert_array_equal(made.network_input("restore"), wanted)


# ------------------------------------------------------------------------------- what it gives


@pytest.mark.parametrize("size", SIZES.values(), ids=SIZES)
@pytest.mark.parametrize("scale", [1, 2, 3])
@pytest.mark.parametrize("tile_px", [None, 16, 30])
def test_tiles_of_any_scale_give_the_bits_of_the_whole(
    tmp_path: Path, size: tuple[int, int], scale: int, tile_px: int | None
) -> None:
    camera = _camera(tmp_path, 2, [2], scale=scale, transform="none")
    light = _light(2, size)
    made = start(camera, made_planes(samples=light), tile_px=tile_px)
    assert made.shape == (2, scale * size[0], scale * size[1])
    np.testing.assert_array_equal(made.fill(), _whole(camera, light))


@pytest.mark.parametrize("channels", [1, 3, 5])
@pytest.mark.parametrize("ports", [1, 2, 3])
@pytest.mark.parametrize("scale", [1, 2])
def test_ports_are_split_and_stabilised_ones_become_light_again(
    tmp_path: Path, channels: int, ports: int, scale: int
) -> None:
    camera = _camera(tmp_path, channels, [channels] * ports, scale=scale)
    light = _light(channels)
    made = start(camera, made_planes(samples=light), tile_px=32)
    noise = made.job.noise
    stable = _whole(camera, stabilise(light, noise, scale=64.0))
    for number, name in enumerate(camera.manifest.products.values()):
        part = stable[number * channels : (number + 1) * channels]
        found = read_all(made.rows_of(name), 33)
        np.testing.assert_array_equal(found, unstabilise(part.copy(), noise, scale=64.0))


def test_ports_of_different_channels_are_split_where_nothing_is_stabilised(tmp_path: Path) -> None:
    camera = _camera(tmp_path, 4, [1, 3, 2], scale=2, transform="none")
    light = _light(4)
    made = start(camera, made_planes(samples=light), tile_px=32)
    whole = _whole(camera, light)
    for name, part in zip(("image", "plane1", "plane2"), np.split(whole, [1, 4]), strict=True):
        assert made.shape_of(name) == part.shape
        np.testing.assert_array_equal(made.fill(product=name), part)


def test_two_ports_read_at_different_pace_are_parts_of_one_run(tmp_path: Path) -> None:
    """Both planes taken by one stage behind: the network runs once over the picture."""
    data, join = finer_network(1, 2, scale=2), finer_network(2, 1, scale=1, seed=9)
    one = Port(name="a", channels=1)
    fine = one.model_copy(update={"scale": 2})
    stages = (
        Linearise(gives=("light",)),
        Network(role="split", takes=("light",), gives=("near", "far"), transform="none"),
        Network(role="fuse", takes=("far", "near"), gives=("both",), transform="none"),
        Color(takes=("both",)),
    )
    camera = write_planes_bundle(
        tmp_path,
        stages,
        sensor=planes_sensor(size_px=None),
        networks={
            "split": (facts_of(data, [one], [fine, fine], "split.onnx"), data),
            "fuse": (facts_of(join, [one, one], [one], "fuse.onnx"), join),
        },
    )
    light = _light(1)
    ticks: list[tuple[int, int]] = []
    from camkit.runtime.options import Options
    from camkit.runtime.pipeline import Pipeline

    pipeline = Pipeline(camera, Options(tile_px=32, threads=1))
    made = pipeline.start(made_planes(samples=light), progress=lambda *tick: ticks.append(tick))
    picture = made.fill()
    split = NetworkEngine(data, threads=1, scale=2).run(light[None])[0]
    fused = NetworkEngine(join, threads=1).run(np.ascontiguousarray(split[::-1])[None])[0]
    np.testing.assert_array_equal(picture, np.repeat(fused, 3, axis=0))
    windows = sum(windows.to_json()["windows"] for windows in made.windows.values())
    assert len(set(ticks)) == len(ticks) >= windows, "every window, and what other stages give"
    assert ticks == sorted(ticks)
    assert ticks[-1][0] == ticks[-1][1]


# ------------------------------------------------------------------------------- guard


def _exploding(folder: Path, scale: float, **changes: Any) -> Bundle:
    members = tiny_members() | {"network_m.onnx": tiny_network(scale=scale)}
    path = folder / "wild.camkit"
    write_bundle(path, tiny_manifest(**changes), members)
    return open_bundle(path)


def test_a_tile_that_is_not_believed_takes_the_last_plane_and_says_so(tmp_path: Path) -> None:
    wild = _exploding(tmp_path, 1e4)
    calm = made_mosaic(samples=np.random.default_rng(0).integers(490, 510, (64, 96)).astype("u2"))
    with pytest.raises(ContractError, match=r"values up to .* in tile \(row 0, column 0\)"):
        start(wild, calm).fill()
    made = start(wild, calm, on_unsafe="fallback", tile_px=32)
    bank = start(wild, calm, method="wiener").fill()
    # there and back through the transform
    np.testing.assert_allclose(made.fill(), bank, atol=1e-4)
    *tiles, moved = made.warnings
    assert len(tiles) == made.windows["restore"].to_json()["windows"]
    assert all(text.startswith("the network's result was rejected") for text in tiles)
    assert moved.startswith("in 100.0% of the picture the network and the filter")


def test_where_no_plane_stands_in_a_bad_tile_is_refused_without_a_hint(tmp_path: Path) -> None:
    data = finer_network(1, 1, scale=2)
    ports = [Port(name="a", channels=1)], [Port(name="b", channels=1, scale=2)]
    stages = (
        Linearise(gives=("light",)),
        Network(takes=("light",), gives=("large",), transform="none", most_light=1e-6),
    )
    camera = write_planes_bundle(
        tmp_path,
        stages,
        sensor=planes_sensor(size_px=None),
        networks={"restore": (facts_of(data, *ports), data)},
    )
    bright = made_planes(samples=10 * _light(1))
    for on_unsafe in ("warn", "fallback"):
        with pytest.raises(ContractError, match="values up to") as caught:
            start(camera, bright, on_unsafe=on_unsafe).fill()
        assert "on_unsafe" not in str(caught.value)


def _multiplying(*gains: float) -> bytes:
    """Return the small network of as many planes, its outputs multiplied."""
    import onnx
    from onnx import numpy_helper

    model = onnx.load_from_string(finer_network(len(gains), len(gains), scale=1))
    for tensor in model.graph.initializer:
        if tensor.name == "tail.weight":
            weight = numpy_helper.to_array(tensor)
            outputs = np.repeat(np.float32(gains), len(weight) // len(gains))
            scaled = outputs.reshape(-1, *[1] * (weight.ndim - 1)) * weight
            tensor.CopyFrom(numpy_helper.from_array(scaled, tensor.name))
    return bytes(model.SerializeToString(deterministic=True))


@pytest.mark.parametrize(("transform", "believed"), [("none", 300.0), ("stabilise", 300.0**2)])
def test_how_much_light_is_believed_is_told_by_the_bundle(
    tmp_path: Path, transform: str, believed: float
) -> None:
    """HDR gives 256 times the light of its tile; the square root stands before the bound."""
    port = Port(name="a", channels=1)
    data = _multiplying(300.0)
    for most_light, sound in ((16.0, False), (2.5 * believed, True)):
        stages = (
            Linearise(gives=("light",)),
            Network(
                takes=("light",),
                gives=("bright",),
                transform=transform,  # type: ignore[arg-type]
                most_light=most_light,
            ),
        )
        camera = write_planes_bundle(
            tmp_path,
            stages,
            sensor=planes_sensor(size_px=None),
            networks={"restore": (facts_of(data, [port], [port]), data)},
        )
        work = start(camera, made_planes(samples=np.full((1, 64, 96), 0.5, np.float32)))
        if sound:
            assert work.fill().max() > 100
        else:
            with pytest.raises(ContractError, match="beyond"):
                work.fill()


def _dimmed(tmp_path: Path, gain: float, *, keeps_white: bool) -> Bundle:
    """Return a camera of planes whose network gives so much more or less (stabilised)."""
    port, data = Port(name="a", channels=1), _multiplying(gain)
    stages = (
        Linearise(gives=("light",)),
        Network(takes=("light",), gives=("clean",), keeps_white=keeps_white),
    )
    return write_planes_bundle(
        tmp_path,
        stages,
        sensor=planes_sensor(size_px=None),
        networks={"restore": (facts_of(data, [port], [port]), data)},
        format_version="2.8",
    )


def test_a_network_that_keeps_white_darkens_no_lamp_below_it(tmp_path: Path) -> None:
    """Light below white stays at least as bright, light above it may be lowered to white."""
    light = made_planes(samples=np.tile(np.array([0.2, 0.9, 1.5, 40], np.float32), (1, 64, 24)))
    dark = start(_dimmed(tmp_path, 0.01, keeps_white=False), light).fill()
    assert dark.max() < 0.2
    got = start(_dimmed(tmp_path, 0.01, keeps_white=True), light).fill()
    np.testing.assert_allclose(got[0, :, :4], np.tile([0.2, 0.9, 1.0, 1.0], (64, 1)), rtol=1e-3)


def test_a_network_that_raises_colours_apart_keeps_lamps_white_in_the_output(
    tmp_path: Path,
) -> None:
    """Red and blue far above white take green away behind the colour matrix."""
    data, port = _multiplying(6, 0.01, 6), Port(name="a", channels=3)
    stages = (
        Linearise(gives=("light",)),
        Network(takes=("light",), gives=("clean",), keeps_white=True, most_light=4e3),
        Color(takes=("clean",)),
    )
    camera = write_planes_bundle(
        tmp_path,
        stages,
        sensor=planes_sensor(("R", "G", "B"), size_px=None),
        networks={"restore": (facts_of(data, [port], [port]), data)},
        products={"image": "picture"},
        format_version="2.8",
    )
    matrix = np.array([[0.66, -0.18, -0.05], [-0.52, 1.3, 0.25], [-0.1, 0.17, 0.65]])
    light = made_planes(samples=np.full((3, 64, 96), 2, np.float32), color_matrix=matrix)
    shown, raw = (start(camera, light, color=color).fill() for color in ("rec709", "camera"))
    assert raw.min() > 0.99
    assert raw[0].max() > 2 * raw[1].min()
    assert shown.min() > 0.99


def test_what_a_network_that_keeps_white_adds_stays(tmp_path: Path) -> None:
    light = made_planes(samples=np.full((1, 64, 96), 0.5, np.float32))
    free, kept = (
        start(_dimmed(tmp_path, 1.2, keeps_white=keeps), light).fill() for keeps in (False, True)
    )
    np.testing.assert_allclose(kept, np.maximum(free, 0.5), rtol=1e-5)
    assert free.max() > 0.6


# ------------------------------------------------------------------------------- envelope


def test_a_capture_outside_the_envelope_is_told_once_however_many_networks(
    tmp_path: Path,
) -> None:
    data = finer_network(1, 1, scale=1)
    port = Port(name="a", channels=1)
    stages = (
        Linearise(gives=("light",)),
        Network(role="one", takes=("light",), gives=("calm",)),
        Network(role="two", takes=("calm",), gives=("clean",)),
    )
    camera = write_planes_bundle(
        tmp_path,
        stages,
        sensor=planes_sensor(size_px=None),
        networks={
            role: (facts_of(data, [port], [port], f"{role}.onnx"), data) for role in ("one", "two")
        },
        envelope={"side_px": Range(low=1000, high=9000)},
    )
    capture = made_planes(samples=_light(1))
    made = start(camera, capture)
    assert len(made.job.log.notes) == 1
    assert made.size == "M"
    back = start(camera, capture, on_unsafe="fallback")
    assert back.record["envelope"]["fallback"]
    assert back.size is None
    assert len(back.job.log.notes) == 1
    np.testing.assert_array_equal(back.fill(), capture.samples)
    with pytest.raises(ContractError, match="outside the measured range"):
        start(camera, capture, on_unsafe="fail")


def test_a_network_before_the_bank_runs_with_it_and_is_held_against_the_envelope(
    tmp_path: Path,
) -> None:
    data = finer_network(1, 1, scale=1)
    port = Port(name="a", channels=1)
    stages = (
        Linearise(gives=("light",)),
        Network(takes=("light",), gives=("calm",)),
        Wiener(takes=("calm",), block_px=32, overlap_px=8, prior_scale=1e-3, prior_exponent=2.0),
    )
    psf = replace(uniform_psf(streak_kernel(0.0, 3, 4)), pixel_pitch_um=PITCH_UM)
    camera = write_planes_bundle(
        tmp_path,
        stages,
        sensor=planes_sensor(),
        psf=psf,
        networks={"restore": (facts_of(data, [port], [port]), data)},
        envelope={"side_px": Range(low=1000, high=9000)},
    )
    capture = made_planes(samples=_light(1))
    for method in (None, "wiener", "rl"):
        made = start(camera, capture, method=method)
        assert "envelope" in made.record
        assert made.size == "M"
    back = start(camera, capture, on_unsafe="fallback")
    assert (back.size, back.job.work.method) == (None, "develop")
    np.testing.assert_array_equal(back.fill(), capture.samples)


def test_where_no_network_runs_the_envelope_is_not_looked_at(bundle: Bundle) -> None:
    narrow = replace(
        bundle,
        manifest=bundle.manifest.model_copy(
            update={"envelope": {"side_px": Range(low=1000, high=9000)}}
        ),
    )
    assert "envelope" not in start(narrow, made_mosaic(), method="wiener").record
    assert "envelope" in start(narrow, made_mosaic()).record
