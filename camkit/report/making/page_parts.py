"""Parts of the page of a made camera that take work: pictures, seconds, the drawing of a lens."""

import time
from pathlib import Path
from typing import Final

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.colorimetry import encode_srgb
from camkit.models_def.optics.analysis.sampling import Pupil
from camkit.models_def.optics.lens_file.lens_file import read_lens
from camkit.report.figure import to_png
from camkit.report.making.camera_judging import (
    TRUTH,
    captures_of,
    pipelines_of,
    restored_by,
)
from camkit.report.pages.lens.layout import draw_layout
from camkit.report.pages.lens.lens_facts import analyse
from camkit.report.quality import Exposed
from camkit.runtime.twin.simulate import SimulationOptions, photograph
from camkit.scenes.procedural import procedural_scene

TIMED_PX: Final = 1024
SEED: Final = 92_000
MEGAPIXEL: Final = 1e6


def pictures_of(bundle: Bundle, pictures: Path | None, cache_folder: Path) -> dict[str, FloatArray]:
    """Return one capture by every method and the truth: title -> (3, h, w) sRGB values."""
    _, exposed = next(iter(captures_of(bundle, pictures, cache_folder)))
    by_method = {
        name: encode_srgb(restored_by(pipeline, exposed))
        for name, pipeline in pipelines_of(bundle).items()
    }
    return {**by_method, TRUTH: exposed.sharp}


def seconds_of(bundle: Bundle) -> dict[str, float]:
    """Return the CPU-seconds of every method for the whole sensor, by those of a part of it."""
    sensor = bundle.manifest.light_sensor
    height, width = (min(TIMED_PX, side // 2 * 2) for side in (sensor.height_px, sensor.width_px))
    scene = procedural_scene(SEED, height, width)
    simulation = photograph(
        scene, bundle, SimulationOptions(iso=400.0, depth_mm=bundle.psf.depths_mm[0])
    )
    share = sensor.width_px * sensor.height_px / (height * width)
    seconds = {}
    exposed = Exposed(simulation=simulation, truths={})
    for name, pipeline in pipelines_of(bundle).items():
        began_s = time.process_time()
        restored_by(pipeline, exposed)
        seconds[f"a whole capture, {name}"] = share * (time.process_time() - began_s)
    return seconds


def layout_of(path: Path) -> bytes:
    """Return the drawing of a lens as PNG."""
    return to_png(draw_layout(analyse(read_lens(path), Pupil(), image=False)))
