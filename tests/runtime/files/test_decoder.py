"""The decoding child: ready ahead of its order, replaced where it died, gone with the block."""

import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from camkit.errors import DecodeError
from camkit.runtime.files import decoder
from camkit.runtime.files.decoder import child_environment, decoder_ahead
from camkit.runtime.raw import read_capture
from tests.dng_factory import write_scene


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[decoder.Decoder]:
    """Give every child that is started."""
    children: list[decoder.Decoder] = []
    real = decoder._started

    def listed(arguments: list[str], *, stdin: int) -> decoder.Decoder:
        children.append(real(arguments, stdin=stdin))
        return children[-1]

    monkeypatch.setattr(decoder, "_started", listed)
    return children


def test_the_first_file_is_decoded_by_the_child_that_waits(
    tmp_path: Path, started: list[decoder.Decoder]
) -> None:
    path = tmp_path / "ä \udce9.dng"
    mosaic = write_scene(path)
    with decoder_ahead():
        for count in (1, 2):
            np.testing.assert_array_equal(read_capture(path).samples, mosaic)
            assert len(started) == count
    assert all(one.child.returncode == 0 for one in started)


def test_what_the_child_refuses_is_told_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "x.dng").write_bytes(b"no picture")
    with decoder_ahead(), pytest.raises(DecodeError, match=r"x\.dng"):
        read_capture(tmp_path / "x.dng")


def test_a_child_that_nobody_needs_ends_with_the_block(started: list[decoder.Decoder]) -> None:
    with decoder_ahead():
        assert started[0].child.poll() is None
    assert started[0].child.returncode is not None
    assert started[0].complaints.closed


@pytest.mark.parametrize("dead", [True, False])
def test_a_child_that_died_while_it_waited_is_replaced(
    tmp_path: Path, started: list[decoder.Decoder], monkeypatch: pytest.MonkeyPatch, *, dead: bool
) -> None:
    mosaic = write_scene(tmp_path / "x.dng")
    with decoder_ahead():
        started[0].child.kill()
        started[0].child.wait()
        if not dead:  # it dies between the question and the order
            monkeypatch.setattr(started[0].child, "poll", lambda: None)
        np.testing.assert_array_equal(read_capture(tmp_path / "x.dng").samples, mosaic)
    assert len(started) == 2


def test_the_child_finds_a_checkout_that_is_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", "elsewhere")
    found = child_environment()["PYTHONPATH"].split(os.pathsep)
    assert found[0] == "elsewhere"


def test_the_child_that_waits_serves_any_thread(
    tmp_path: Path, started: list[decoder.Decoder]
) -> None:
    mosaic = write_scene(tmp_path / "x.dng")
    with decoder_ahead(), ThreadPoolExecutor(2) as pool:
        captures = list(pool.map(read_capture, [tmp_path / "x.dng"] * 2))
    for capture in captures:
        np.testing.assert_array_equal(capture.samples, mosaic)
    assert len(started) == 2
    assert all(one.child.returncode == 0 for one in started)
