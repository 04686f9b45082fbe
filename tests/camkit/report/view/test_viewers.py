"""The viewers of a page in Debian's Chromium: sliders, exposure, maps, films, keys and widths."""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
import OpenEXR
import pytest

import camkit
from camkit.arrays import FloatArray
from camkit.runtime.color import encode_uint8
from tests.chromium import PROGRAM, Page, chromium

pytestmark = pytest.mark.skipif(
    not PROGRAM.exists(), reason=f"{PROGRAM} is not there; install chromium to test the page"
)
SHOWN: Final = (
    "[...document.querySelectorAll('.viewer')].every((one) => one.dataset.shown !== undefined)"
)
LAMP: Final = 60.0
SIZE_PX: Final = (400, 600)
EDGE_PX: Final = 40


def _write_exr(path: Path, light: FloatArray) -> None:
    pixels = np.ascontiguousarray(light.transpose(1, 2, 0))
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION}, {"RGB": pixels}).write(str(path))


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a bright EXR, what it was before, depth and a film."""
    folder = tmp_path_factory.mktemp("view")
    light = np.full((3, *SIZE_PX), 0.25, np.float32)
    light[:, 100:200, 100:200] = LAMP
    _write_exr(folder / "after.exr", light)
    _write_exr(folder / "before.exr", np.minimum(light, 1.0) / 2)
    y, x = np.mgrid[0:32, 0:64]
    depth = np.where(x < EDGE_PX, 1.5, 3.0)
    depth[0, 0] = np.nan
    sigma = np.full(depth.shape, 20.0, np.float32)
    np.savez(folder / "depth.npz", depth_m=depth, sigma_ps=sigma, intensity=y.astype(np.float32))
    frames = np.arange(12, dtype=np.float32).repeat(64).reshape(12, 8, 8)
    np.savez(folder / "film.npz", frames=frames)
    return folder


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    with chromium(tmp_path_factory.mktemp("profile")) as page:
        yield page


def _open(browser: Page, path: Path, **options: object) -> None:
    browser.open(path.as_uri(), **options)
    browser.wait(SHOWN)


@pytest.fixture(scope="module")
def compared(pictures: Path) -> Path:
    return camkit.view(
        pictures / "after.exr", pictures / "a.html", before_file=pictures / "before.exr"
    ).path


@pytest.fixture(scope="module")
def photons(pictures: Path) -> Path:
    return camkit.view([pictures / "depth.npz", pictures / "film.npz"], pictures / "b.html").path


def _code(browser: Page, canvas: str, x: int, y: int) -> int:
    return browser.value(
        f"document.querySelector('{canvas}').getContext('2d').getImageData({x}, {y}, 1, 1).data[0]"
    )


def _srgb(light: float) -> int:
    return int(encode_uint8(np.full((1, 1, 1), light, np.float32), tone="srgb")[0, 0, 0])


def test_light_comes_back_from_the_page_at_every_exposure(browser: Page, compared: Path) -> None:
    _open(browser, compared)
    for stops in (0, -6, 2):
        browser.value(
            "(() => { const one = document.querySelector('.exposure'); one.value = "
            f"{stops}; one.dispatchEvent(new Event('input')); }})()"
        )
        browser.wait(f"document.querySelector('.exposure').valueAsNumber === {stops}")
        browser.value("new Promise((keep) => setTimeout(keep, 100))")
        for (x, y), light in (((50, 50), 0.25), ((150, 150), LAMP)):
            assert abs(_code(browser, "canvas.after", x, y) - _srgb(light * 2.0**stops)) <= 1
        assert abs(_code(browser, "canvas.before", 50, 50) - _srgb(0.125 * 2.0**stops)) <= 1
    assert browser.console == []


def test_keys_alone_move_the_border_and_change_the_exposure(browser: Page, compared: Path) -> None:
    _open(browser, compared)
    cut = "document.querySelector('canvas.after').style.clipPath"
    visited = []
    for _ in range(12):
        browser.press("Tab")
        name = browser.value("document.activeElement.className")
        visited.append(name)
        style = "getComputedStyle(document.activeElement).outlineStyle"
        assert browser.value(style) != "none", name
        if name == "exposure":
            break
        if name in {"stage", "split"}:
            old = browser.value(cut)
            browser.press("ArrowRight")
            browser.wait(f"{cut} !== {old!r}")
    assert [name for name in visited if name] == ["stage", "split", "exposure"]
    browser.value(
        "document.activeElement.dispatchEvent(new KeyboardEvent('keydown', "
        "{ key: '-', bubbles: true }))"
    )
    assert browser.value("document.querySelector('.exposure').value") == "-0.5"


def test_a_map_says_its_values_and_its_scale(browser: Page, photons: Path) -> None:
    _open(browser, photons)
    assert browser.value("document.querySelector('.low').textContent") == "1.500 m"
    assert browser.value("document.querySelector('.high').textContent") == "3.000 m"
    near, far = (
        browser.value(
            "[...document.querySelector('canvas.values').getContext('2d')"
            f".getImageData({x}, 9, 1, 1).data]"
        )
        for x in (EDGE_PX - 1, EDGE_PX)
    )
    assert near[0] > near[2]  # near is red, far blue
    assert far[2] > far[0]
    browser.value(
        "(() => { const one = document.querySelector('canvas.values'); "
        "const box = one.getBoundingClientRect(); one.dispatchEvent(new PointerEvent("
        "'pointermove', { clientX: box.left + box.width * 50.5 / 64, "
        "clientY: box.top + box.height * 8.5 / 32 })); })()"
    )
    text = "document.querySelector('.readout').textContent"
    wanted = "x 50, y 8: depth 3.000 m; sigma of depth 0.002998 m; photons 8.000 photons"
    assert browser.value(text) == wanted
    browser.value("document.querySelector('.stage').focus()")
    browser.press("ArrowLeft")
    assert browser.value(text).startswith("x 49, y 8:")
    browser.value("document.querySelectorAll('.choice button')[1].click()")
    browser.wait("document.querySelector('.low').textContent === '0.002998 m'")


def test_a_film_shows_every_frame(browser: Page, photons: Path) -> None:
    _open(browser, photons)
    film = "document.querySelector('[data-kind=film] .frame')"
    codes = []
    for frame in (0, 5, 11):
        browser.value(f"({film}.value = {frame}, {film}.dispatchEvent(new Event('input')))")
        codes.append(_code(browser, "[data-kind=film] canvas", 3, 3))
    assert codes[0] == 0 < codes[1] < codes[2] == 255
    assert browser.value(f"{film}.parentElement.querySelector('output').textContent") == (
        "frame 12 of 12"
    )


@pytest.mark.parametrize("width", [360, 1280, 2560])
@pytest.mark.parametrize("dark", [False, True])
def test_the_page_fits_its_window_by_day_and_night_and_asks_for_nothing(
    browser: Page, compared: Path, photons: Path, width: int, dark: bool
) -> None:
    for path in (compared, photons):
        browser.requests.clear()
        _open(browser, path, size=(width, 800), dark=dark)
        assert browser.value("document.documentElement.scrollWidth") <= width
        assert all(url.startswith(("file:", "data:")) for url in browser.requests)
        sides = browser.value(
            "[...document.querySelectorAll('.viewer button, .viewer [type=range], .check')]"
            ".filter((one) => one.offsetParent).map((one) => one.getBoundingClientRect().height)"
        )
        assert min(sides) >= 40
        paper = browser.value("getComputedStyle(document.body).backgroundColor")
        assert (paper == "rgb(22, 23, 25)") == dark
        labels = browser.value(
            "[...document.querySelectorAll('canvas[role=img], img')]"
            ".every((one) => one.getAttribute('aria-label') || one.alt)"
        )
        assert labels
    assert browser.console == []
