"""A small database as lensfun's files are written, and captures to go with it."""

from pathlib import Path

import numpy as np

from camkit.runtime.metadata import Metadata
from camkit.runtime.output.dng import write_bayer_dng
from tests.dng_factory import dng_tags, scene_mosaic

ZOOM = "Sharp 24-70mm f/2.8"
TERMS = {24.0: (0.02, -0.06, 0.03), 35.0: (0.01, -0.03, 0.01), 70.0: (0.0, 0.012, 0.0)}
"""a, b, c of its distortion by focal length."""
LENS_XML = f"""
<lens>
    <maker>Example</maker>
    <model>{ZOOM}</model>
    <mount>Generic</mount>
    <cropfactor>1</cropfactor>
    <calibration>
        <distortion model="ptlens" focal="24" a="0.02" b="-0.06" c="0.03"/>
        <distortion model="ptlens" focal="35" a="0.01" b="-0.03" c="0.01"/>
        <distortion model="ptlens" focal="70" b="0.012"/>
        <vignetting model="pa" focal="24" aperture="2.8" distance="10"
            k1="-0.9" k2="0.3" k3="-0.1"/>
        <vignetting model="pa" focal="24" aperture="8" distance="1000" k1="-0.3" k2="0.1" k3="0"/>
        <vignetting model="pa" focal="70" aperture="8" distance="1000" k1="-0.2" k2="0" k3="0"/>
    </calibration>
</lens>
"""
OTHERS_XML = """
<camera>
    <maker>Example</maker>
    <model>Box 2</model>
    <mount>Generic</mount>
    <cropfactor>1.5</cropfactor>
</camera>
<lens>
    <maker>Example</maker>
    <model>Folding 8mm</model>
    <mount>Generic</mount>
    <cropfactor>1</cropfactor>
    <calibration><distortion model="poly3" focal="8" k1="-0.3"/></calibration>
</lens>
<lens>
    <maker>Example</maker>
    <model>Unmeasured 50mm</model>
    <mount>Generic</mount>
    <cropfactor>1</cropfactor>
</lens>
<lens>
    <maker>Example</maker>
    <model>Small 50mm</model>
    <mount>Generic</mount>
    <cropfactor>2</cropfactor>
    <aspect-ratio>4:3</aspect-ratio>
    <calibration><distortion model="poly5" focal="50" k1="-0.02" k2="0.004"/></calibration>
</lens>
"""


def write_database(folder: Path, *lenses: str) -> Path:
    """Write a folder with one file."""
    place = folder / "db"
    place.mkdir(exist_ok=True)
    inside = "".join(lenses or (LENS_XML, OTHERS_XML))
    (place / "example.xml").write_text(
        f'<lensdatabase version="1">{inside}</lensdatabase>', encoding="utf-8"
    )
    return place


def write_shot(path: Path, light: np.ndarray | None = None, *, model: str = "Box 2") -> Path:
    """Write a capture of 240x160 px that names neither a bundle nor its pixel pitch."""
    shown = scene_mosaic(160, 240) if light is None else light
    mosaic = shown.astype(np.uint16)
    told = Metadata(iso=400, f_number=2.8, make="Example", model=model)
    tags = dng_tags(description="", camera_model=model, metadata=told)
    write_bayer_dng(path, mosaic, tags=tags)
    return path
