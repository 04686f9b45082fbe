"""The comparison of a real lens, on simulated pictures in place of the photographs."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.models_def.optics.render import pair_transfer
from camkit.runtime.signal.halves import right_half
from tests.pair_factory import LENS, WORDS, Truth, write_pair
from tools.comparison import real_lens, real_lens_pages
from tools.comparison.real_lens import Comparison, Shot


@pytest.fixture
def photographs(tmp_path: Path) -> Path:
    """Return a folder as of the data."""
    data = tmp_path / "data"
    (data / "plain").mkdir(parents=True)
    for path, stop in zip(
        write_pair(data / "plain", Truth(), object_m=1.5), ("f4", "f20"), strict=True
    ):
        for half in "lr":
            shutil.copy(path, data / f"1500_{stop}_{half}.png")
    return data


def test_every_way_is_judged_forward_and_inverse(
    photographs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pair_transfer, "RAYS", 300)
    monkeypatch.setattr(real_lens, "LENS", LENS)
    monkeypatch.setattr(real_lens, "TONE", "srgb")
    monkeypatch.setattr(Shot, "words", property(lambda _shot: replace(WORDS, object_m=1.5)))
    monkeypatch.setattr(real_lens_pages, "SIDE_PX", 64)
    monkeypatch.setattr(real_lens_pages, "PLACES", {"centre": (96, 64)})
    cameras: list[dict[str, Any]] = []
    monkeypatch.setattr(Comparison, "_make", lambda _self, _out, words: cameras.append(words))
    monkeypatch.setattr(Comparison, "_restored", _restored)
    lens_path = photographs / LENS
    monkeypatch.setattr(real_lens, "place_pair", lambda path, *rest: _place(path, lens_path, *rest))
    monkeypatch.setattr(real_lens.camkit.calibrate, "distance", _distance, raising=False)
    out = tmp_path / "found" / "real-lens"
    words = ["--data", str(photographs), "--tone", "srgb", "--crops", str(tmp_path / "crops")]
    real_lens.main([*words, "-o", str(out)])
    record = json.loads(out.with_suffix(".json").read_text(encoding="utf-8"))
    shot = record["1500 mm"]
    blurs = {row["blur"]: row["psnr_db"] for row in shot["forward"]}
    assert blurs["lens, from vertex"] > blurs["disc"] > blurs["Gaussian"] > blurs["none"]
    restored = {row["method"]: row["psnr_db"] for row in shot["inverse"]}
    assert restored["wiener, from vertex"] > restored["untouched"]
    assert {"distance_from": "sensor", "glass": ("names",)} in cameras
    page = out.with_suffix(".md").read_text(encoding="utf-8")
    assert "distances may count from the first vertex" in page
    assert "held back" not in page
    crops = sorted(path.name for path in (tmp_path / "crops").iterdir())
    assert crops == ["real-lens-1500-forward.jpg", "real-lens-1500-inverse.jpg"]


def test_what_is_held_back_is_read_by_its_own_names(tmp_path: Path) -> None:
    fitted, held_out = real_lens.shots_of(tmp_path, tmp_path / "0600")
    assert (fitted.object_m, held_out.object_m) == (1.5, 0.6)
    assert held_out.files[0] == tmp_path / "0600" / "f4" / "l.png"
    assert right_half(held_out.files[0], held_out.halves).name == "r.png"
    assert held_out.words.sharp_stop_radius_mm == 0.73


def _restored(comparison: Comparison, _bundle: Path, _method: str | None) -> FloatArray:
    wide = comparison.scene.judges["srgb"].pair.wide
    soft = np.stack([cv2.GaussianBlur(plane, (0, 0), 1.5) for plane in wide])
    return np.clip(wide + (wide - soft), 0, 1).astype(np.float32)


def _place(path: Path, lens_path: Path, *rest: Any) -> Any:
    from camkit.calibrate.placed_pair import place_pair

    return place_pair(Path(LENS) if path == lens_path else path, *rest)


def _distance(files: Any, _lens: Path, **options: Any) -> Any:
    from camkit.calibrate.lens_distance import distance

    return distance(files, LENS, **{**options, "tones": ("srgb",)})
