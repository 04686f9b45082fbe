"""Real captures, where somebody has them: `--data DIR`, a folder of RAW files and scans of photons.

Captures that the folder lacks are left out.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from tools.evidence.ways import Options

REAL: Final[tuple[tuple[str, str | None, Options], ...]] = (
    ("raw/canon_kissx4_magiclantern_colorchart.dng", None, {}),
    ("raw/canon_kissx4_magiclantern_colorchart.dng", "duet", {"assume": "scale"}),
    ("raw/canon_g2_colorchecker_CRW_0304.CRW", None, {}),
    ("raw/canon_g2_colorchecker_CRW_0304.CRW", "deglare", {}),
    ("raw/kodak_dc120_P003917.KDC", None, {"demosaic": "quality"}),
    ("raw/canon_eos6d_linear_lossy.dng", None, {}),
    ("flare/flare7k_input1.png", "deglare", {}),
)
TOWER: Final = """
timing = {orientation = "histogram", time_bin_ps = 200, first_ps = 5180100, bins = 1000}
laser = {fwhm_ps = 1000}
array = {key = "data_processed"}
"""
WALL: Final = """
timing = {orientation = "histogram", time_bin_ps = 4}
array = {axes = "yxt", key = "rect_data"}
"""
CELLS: Final = "lifetime = {from_ps = 1000, to_ps = 11700}\n"
REAL_PHOTONS: Final[tuple[tuple[str, str, Options], ...]] = (
    *(("spad/tower_9.8km.mat", TOWER, way) for way in ({}, {"method": "lsq"}, {"returns": "2"})),
    ("spad/lct_outdoor_s.mat", WALL, {"product": "transient"}),
    ("spad/bh_flim_128x128x256.sdt.zip", CELLS, {"product": "lifetime"}),
)


def real_jobs(data: Path, work: Path) -> Iterator[dict[str, Any]]:
    """Yield the jobs of a worker; timing files are written to the folder of work."""
    for name, bundle, options in REAL:
        if (data / name).is_file():
            yield {
                "bundle": bundle,
                "capture": str(data / name),
                "is_photograph": True,
                "options": options,
            }
    for name, timing, options in REAL_PHOTONS:
        if (data / name).is_file():
            file = work / f"{Path(name).stem}.toml"
            file.write_text(timing, encoding="utf-8")
            yield {
                "bundle": None,
                "kind": "spad",
                "capture": str(data / name),
                "is_photograph": False,
                "options": {**options, "timing": str(file)},
            }
