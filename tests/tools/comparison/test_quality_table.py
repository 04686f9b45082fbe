import pytest

from tools.comparison.measurement import Measurement
from tools.comparison.quality_table import (
    comparable,
    gains,
    means,
    seconds_per_megapixel,
    summarise,
    to_markdown,
)

METHODS = ("input", "skimage_wiener", "admm_tv", "bank", "M", "U-Net")
LEVELS = dict(zip(METHODS, (20.0, 22.0, 23.0, 23.5, 25.5, 25.0), strict=True))


def run(psf: str = "fresh", pictures: int = 2) -> list[Measurement]:
    return [
        Measurement(
            psf=psf,  # type: ignore[arg-type]
            set_name="set",
            picture=f"{number}.png",
            position=position,
            height_mm=5.0 * position,
            iso=iso,
            seed=2001,
            method=method,
            psnr_db=level + number - (1 if iso > 100 else 0),
            ssim=level / 50,
            seconds=0.5,
            megapixels=0.25,
            identity="x",
        )
        for number in range(pictures)
        for position in (0, 1)
        for iso in (100.0, 1600.0)
        for method, level in LEVELS.items()
    ]


def report(measurements: list[Measurement]) -> dict[str, object]:
    return {
        "commands": ["python -m tools.quality --psf fresh", "python -m tools.quality --resume"],
        "json_name": "quality.json",
        "bundle": {"name": "tiny"},
        "machine": {"cpu": "a processor", "cores": 2},
        "earlier_runs": {"another processor": ["input", "admm_tv"]},
        "protocol": {"text": ["as stated"]},
        "tuned": {
            "data": "valid",
            "values": {"admm_tv": {"100": {"weight": 20.0, "iterations": 12.0}}},
        },
        "methods": list(METHODS),
        "copies": {"2001": 0.074},
        "summary": summarise(measurements, METHODS),
    }


def test_means_are_over_all_captures_of_the_group() -> None:
    overall = means(run())[()]
    assert overall["M"].psnr_db == pytest.approx(25.5 + 0.5 - 0.5)
    assert overall["M"].count == 8
    by_iso = means(run(), "iso")
    assert by_iso[(100.0,)]["M"].psnr_db == pytest.approx(26.0)
    assert by_iso[(1600.0,)]["M"].psnr_db == pytest.approx(25.0)


def test_gains_are_over_the_best_classical_method() -> None:
    gain = gains(means(run())[()])
    assert gain["best_classical"] == "admm_tv"
    assert gain["over_best_classical_db"] == pytest.approx(2.5)
    assert gain["over"]["bank"] == pytest.approx(2.0)
    assert gain["over"]["U-Net"] == pytest.approx(0.5)
    assert gains({}) == {}


def test_captures_that_lack_a_method_are_left_out_of_the_comparison() -> None:
    found = run()
    missing = found.pop(-1)
    kept = comparable(found, METHODS)
    assert len(kept) == len(run()) - len(METHODS)
    assert all(m.capture != missing.capture for m in kept)


def test_the_page_holds_every_number_and_says_which_aims_were_reached() -> None:
    page = to_markdown(report(run() + run("bundle")))
    assert "| network M over ADMM-TV | +2.50 +- 0.00 | +2.5: reached |" in page
    assert "| our Wiener bank over ADMM-TV | +0.50 +- 0.00 | +0.5: reached |" in page
    assert "| network M over U-Net | +0.50 +- 0.00 |  |" in page
    assert page.startswith("# Quality of `tiny`\n\nBest in PSNR over 8 captures: network M, 25.50 ")
    assert "2001, off by 0.07" in page
    assert "| network M | 26.00 / 0.510 | 25.00 / 0.510 | 25.50 / 0.510 |" in page
    assert "1 (5.0 mm), n = 2" in page
    assert "the bundle's own PSF" in page
    assert "ADMM-TV: weight 20, iterations 12 at ISO 100." in page
    assert "run on another processor measured input (developed only) and ADMM-TV." in page
    assert "`python -m tools.quality --psf fresh`, then `python -m tools.quality --resume`" in page


def test_an_aim_that_is_not_reached_stands_with_what_lacks() -> None:
    low = [m for m in run() if m.method != "bank"]
    level = [Measurement(**{**_fields(m), "method": "bank"}) for m in low if m.method == "admm_tv"]
    wanted = "| our Wiener bank over ADMM-TV | +0.00 +- 0.00 | +0.5: 0.50 below |"
    assert wanted in to_markdown(report(low + level))


def test_seconds_are_per_megapixel() -> None:
    assert seconds_per_megapixel(run())["M"] == pytest.approx(2.0)


def _fields(m: Measurement) -> dict[str, object]:
    return {name: getattr(m, name) for name in Measurement.__dataclass_fields__}
