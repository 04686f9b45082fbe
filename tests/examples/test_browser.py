"""The example page in Debian's Chromium: opened as a file, and served with threads."""

import base64
import functools
import http.server
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.runtime.output.dng import write_bayer_dng
from tests.chromium import PROGRAM, Page, chromium
from tests.dng_builder import build_dng
from tests.dng_factory import dng_tags, scene_mosaic
from tests.examples.built_examples import PAGE, build_examples
from tests.examples.portable_cases import PortableCamera, difference_db, make_camera

LEAST_DB: Final = 120.0
"""Of the page to the Python reader, which computes on other hardware."""
READY: Final = "document.querySelector('#engine').textContent.startsWith('Ready')"
DONE: Final = "document.querySelector('#news').textContent.startsWith('Done')"
SHOWN: Final = "!document.querySelector('#result').hidden"
REFUSED: Final = "!document.querySelector('#error').hidden"
LIGHT: Final = """
new Promise((keep) => {
  addEventListener("light", ({ detail }) => {
    const bytes = new Uint8Array(detail.light.buffer);
    let text = "";
    for (let i = 0; i < bytes.length; i += 8192)
      text += String.fromCharCode(...bytes.subarray(i, i + 8192));
    keep([detail.height, detail.width, btoa(text)]);
  }, { once: true });
  dispatchEvent(new Event("askforlight"));
})
"""


@pytest.fixture(scope="module")
def camera(tmp_path_factory: pytest.TempPathFactory) -> PortableCamera:
    if not PROGRAM.exists():
        pytest.skip(f"{PROGRAM} is not there; install chromium to test the page")
    build_examples()
    return make_camera("duet", "S", tmp_path_factory.mktemp("portable"))


@pytest.fixture(scope="module")
def page(camera: PortableCamera, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    with chromium(tmp_path_factory.mktemp("profile")) as page:
        page.open(PAGE.as_uri())
        page.wait(READY)
        page.choose("#files", camera.archive)
        page.wait("document.querySelector('#camera').textContent.startsWith('duet')")
        yield page


def _develop(page: Page) -> FloatArray:
    """Return (3, h, w), as the page made it of the photograph that it has."""
    page.value("document.querySelector('#develop').click()")
    page.wait(DONE)
    page.wait(SHOWN)
    height, width, text = page.value(LIGHT)
    return np.frombuffer(base64.b64decode(text), np.float32).reshape(3, height, width)


def _take(page: Page, photo: Path) -> None:
    page.value("document.querySelector('#photo').textContent = ''")
    page.choose("#files", photo)
    page.wait(f"document.querySelector('#photo').textContent.startsWith('{photo.name}')")


@pytest.mark.parametrize("name", ["typical", "saturated", "very_dark"])
def test_a_page_opened_as_a_file_makes_the_golden_pictures(
    camera: PortableCamera, page: Page, name: str
) -> None:
    case = camera.cases[name]
    _take(page, case.photo)
    light = _develop(page)
    assert "one thread" in page.value("document.querySelector('#engine').textContent")
    assert difference_db(light, case.light) >= LEAST_DB, float(np.abs(case.light).max())
    if case.output is not None:
        assert float(np.abs(light - case.output).max()) <= case.allowed
    assert page.console == []


def test_nothing_leaves_the_machine(page: Page) -> None:
    assert all(url.startswith(("file:", "blob:", "data:")) for url in page.requests), page.requests
    asked = page.value("fetch('http://127.0.0.1:9/').then(() => 'sent', (error) => String(error))")
    assert "Failed to fetch" in asked
    assert any("Content Security Policy" in line for line in page.console)
    page.console.clear()


def test_a_saved_picture_is_the_light_that_was_made(
    camera: PortableCamera, page: Page, tmp_path: Path
) -> None:
    case = camera.cases["typical"]
    _take(page, case.photo)
    light = np.clip(_develop(page), 0, 1)
    page.call("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    coded = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    for bits in (8, 16):
        page.value(f"document.querySelector('#save{bits}').click()")
        page.wait("document.querySelector('#news').textContent.startsWith('Saved')")
        path = tmp_path / f"typical_{bits}.png"
        saved = _read_png(path)
        assert saved.dtype.itemsize * 8 == bits
        wanted = coded.transpose(1, 2, 0) * (2**bits - 1)
        assert float(np.abs(saved[..., ::-1] - wanted).max()) <= (0.6 if bits == 8 else 0.51)


def _read_png(path: Path) -> np.ndarray[Any, Any]:
    """Wait until a download is complete, and read it."""
    ready = threading.Event()
    for _ in range(100):
        if path.exists() and (made := cv2.imread(str(path), cv2.IMREAD_UNCHANGED)) is not None:
            return made
        ready.wait(0.1)
    raise AssertionError(f"{path} was not saved: {list(path.parent.iterdir())}")


def test_what_cannot_be_used_is_named(page: Page, tmp_path: Path) -> None:
    deflated = build_dng(tmp_path / "deflated.dng", scene_mosaic(), compression=8)
    (tmp_path / "notes.txt").write_text("not a photograph")
    (tmp_path / "torn.zip").write_bytes(b"PK\3\4 and nothing else, not even an end record")
    (tmp_path / "half.onnx").write_bytes(bytes(10))
    for path, word in (
        (deflated, "deflated.dng: The DNG is compressed with Deflate"),
        (tmp_path / "notes.txt", "notes.txt: The file is no TIFF or DNG"),
        (tmp_path / "torn.zip", "The zip is damaged"),
        (tmp_path / "half.onnx", "There is no portable.json"),
    ):
        page.value("document.querySelector('#error').hidden = true")
        page.choose("#files", path)
        page.wait(REFUSED)
        assert word in page.value("document.querySelector('#error').textContent")


def test_keys_alone_develop_cancel_and_compare(camera: PortableCamera, page: Page) -> None:
    _take(page, camera.cases["saturated"].photo)
    page.value("document.querySelector('#result').hidden = true")
    page.value("document.querySelector('#files').focus()")
    for _ in range(10):
        page.press("Tab")
        if page.value("document.activeElement.id") == "develop":
            break
    page.press("Enter")
    page.wait("!document.querySelector('#cancel').hidden")
    page.choose("#files", camera.cases["typical"].photo)
    page.wait(REFUSED)
    assert "cancel it first" in page.value("document.querySelector('#error').textContent")
    page.press("Tab")
    assert page.value("document.activeElement.id") == "cancel"
    page.press("Enter")
    assert page.value("document.querySelector('#news').textContent") == "Cancelled."
    page.wait("document.activeElement.id === 'develop'")
    page.press("Enter")
    page.wait(DONE)
    page.wait(SHOWN)
    page.value("document.querySelector('#split').focus()")
    cut = "document.querySelector('#after').style.clipPath"
    before = page.value(cut)
    page.press("ArrowRight")
    assert page.value(cut) != before


def test_the_page_fits_a_telephone_and_every_control_a_finger(page: Page) -> None:
    page.call(
        "Emulation.setDeviceMetricsOverride",
        width=360, height=740, deviceScaleFactor=1, mobile=True,
    )  # fmt: skip
    page.wait("innerWidth === 360")
    assert page.value("document.documentElement.scrollWidth") <= 360
    sides = page.value(
        "[...document.querySelectorAll('button, select, input[type=number], .button')]"
        ".filter((one) => one.offsetParent).map((one) => one.getBoundingClientRect().height)"
    )
    assert len(sides) >= 10
    assert min(sides) >= 40


@pytest.mark.slow
def test_a_photograph_takes_at_most_three_times_the_python_reader(
    camera: PortableCamera, page: Page, tmp_path: Path
) -> None:
    """Seconds of 1500x1000 pixels, each on one thread, one after the other."""
    photo = tmp_path / "large.dng"
    rng = np.random.default_rng(7)
    write_bayer_dng(photo, rng.integers(300, 1200, (1000, 1500), dtype=np.uint16), tags=dng_tags())
    ratios = []
    _take(page, photo)
    for _ in range(3):
        _develop(page)
        said = page.value("document.querySelector('#news').textContent")
        start = time.perf_counter()
        camera.develop(photo)
        here = time.perf_counter() - start
        there = float(said.split()[2])
        print(f"page {there:.1f} s, Python reader {here:.1f} s")
        ratios.append(there / here)
    assert sorted(ratios)[1] <= 3


class _Isolated(http.server.SimpleHTTPRequestHandler):
    """Serve with the headers that threads need."""

    def end_headers(self) -> None:
        self.send_header("Cross-Origin-Opener-Policy", "same-origin")
        self.send_header("Cross-Origin-Embedder-Policy", "require-corp")
        super().end_headers()

    def log_message(self, *_: Any) -> None:
        """Log nothing."""


def test_a_page_served_with_isolation_uses_threads(camera: PortableCamera, tmp_path: Path) -> None:
    handler = functools.partial(_Isolated, directory=str(PAGE.parent))
    case = camera.cases["typical"]
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with chromium(tmp_path) as page:
            page.open(f"http://127.0.0.1:{server.server_port}/")
            page.wait(READY)
            assert " threads" in page.value("document.querySelector('#engine').textContent")
            page.choose("#files", *sorted(camera.folder.iterdir()), case.photo)
            page.wait("!document.querySelector('#settings').hidden")
            light = _develop(page)
            assert page.console == []
        server.shutdown()
    assert difference_db(light, case.light) >= LEAST_DB, float(np.abs(case.light).max())
