"""Samples decide a hash, headers and dates do not."""

import json
from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import tifffile

from tools.evidence.samples import array_hash, file_samples

PICTURE = np.arange(60, dtype=np.float32).reshape(4, 5, 3)


def test_type_shape_and_every_sample_decide_the_hash_of_an_array() -> None:
    changed = PICTURE.copy()
    changed[-1, -1, -1] = np.nextafter(changed[-1, -1, -1], np.float32(0))
    others = (changed, PICTURE.reshape(5, 4, 3), PICTURE.astype(np.float64))
    assert len({array_hash(PICTURE), *map(array_hash, others)}) == 4
    assert array_hash(np.asfortranarray(PICTURE)) == array_hash(PICTURE)


def test_the_date_of_a_file_does_not_count(tmp_path: Path) -> None:
    found = []
    for date in ("2020:01:01 00:00:00", "2021:01:01 00:00:00"):
        header = {"capDate": date, "type": OpenEXR.scanlineimage}
        exr, tiff = tmp_path / "a.exr", tmp_path / "a.tif"
        OpenEXR.File(header, {"RGB": PICTURE}).write(str(exr))
        tifffile.imwrite(tiff, PICTURE.astype(np.uint16), datetime=date, photometric="rgb")
        found.append((file_samples(exr), file_samples(tiff)))
    assert found[0] == found[1]
    assert found[0][0].keys() == {"0.R", "0.G", "0.B"}
    assert found[0][1] == {"page 0": array_hash(PICTURE.astype(np.uint16))}


def test_every_type_of_file_shows_its_samples(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", depth_m=PICTURE)
    assert file_samples(tmp_path / "a.npz") == {"depth_m": array_hash(PICTURE)}
    cv2.imwrite(str(tmp_path / "a.png"), PICTURE.astype(np.uint8))
    assert file_samples(tmp_path / "a.png") == {"pixels": array_hash(PICTURE.astype(np.uint8))}
    (tmp_path / "a.json").write_text(json.dumps({"size": "M"}), encoding="utf-8")
    assert file_samples(tmp_path / "a.json") == {"size": "M"}
    (tmp_path / "a.ply").write_text("ply", encoding="utf-8")
    assert len(file_samples(tmp_path / "a.ply")["bytes"]) == 16
