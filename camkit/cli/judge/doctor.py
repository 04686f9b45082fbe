"""`camkit doctor`: what this machine has, for a bug report or a first look."""

import json
import os
import platform
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from camkit.cli.choices import Debug, Json
from camkit.cli.say import say
from camkit.entry_points import JUDGE, install_text, missing_packages
from camkit.errors import CamkitError

PACKAGES = [
    "numpy",
    "scipy",
    "onnxruntime",
    "onnx",
    "openvino",
    "rawpy",
    "opencv-python-headless",
    "OpenEXR",
    "tifffile",
    "pillow",
    "scikit-image",
    "safetensors",
    "pydantic",
    "typer",
    "rich",
    "torch",
    "onnxscript",
]
PURPOSES = {
    "charts, pages and scores of pictures": ("judge", JUDGE),
    "design, training and export": ("train", ("torch", "onnxscript", *JUDGE)),
    "photon files (.h5, .mat, .ptu, .sdt)": ("spad", ("h5py", "ptufile", "sdtfile")),
    "TIFFs of rare codecs": ("tiff", ("imagecodecs",)),
    "batches on many machines": ("batch", ("distributed",)),
    "networks in bfloat16": ("openvino", ("openvino",)),
}
"""What an extra is for -> its name and the modules that it brings."""


def doctor(
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Print versions, threads, providers and bundles, and test the RAW decoder."""
    report = examine()
    if json_:
        say(json.dumps(report, indent=2))
        return
    for name, value in report.items():
        if isinstance(value, dict):
            say(f"{name}:" if value else f"{name}: none")
            for key, item in value.items():
                say(f"  {key}: {item}")
        else:
            say(f"{name}: {value}")


def examine() -> dict[str, Any]:
    """Collect the facts that `doctor` prints."""
    from camkit import __version__
    from camkit.bundle.reader import built_in_bundles
    from camkit.kinds import kinds_of_packages
    from camkit.report.bench.machine import memory_mb, package_version, processor_name
    from camkit.runtime.network.engine import available_threads, providers
    from camkit.runtime.network.openvino_session import missing_bfloat16
    from camkit.runtime.stage_finder import states_of_packages

    return {
        "camkit": __version__,
        "python": sys.version.split()[0],
        "platform": platform.platform(),
        "processor": processor_name(),
        "threads": available_threads(None),
        "memory_mb": memory_mb(),
        "providers": ", ".join(providers()),
        "openvino": _openvino_state(missing_bfloat16()),
        "onnxruntime_telemetry": (
            "off" if os.environ.get("ORT_DISABLE_TELEMETRY") == "1" else "not switched off"
        ),
        "raw_decoder": _try_decoder(),
        "ready_for": ready_for(),
        "bundles": {name: str(path) for name, path in sorted(built_in_bundles().items())},
        "kinds_of_packages": kinds_of_packages(),
        "stages_of_packages": states_of_packages(),
        "packages": {name: package_version(name) or "not installed" for name in PACKAGES},
    }


def ready_for() -> dict[str, str]:
    """Return what can be done here, and what is missing for the rest."""
    from camkit import __version__
    from camkit.bundle.reader import install_bundles_text, missing_bundles
    from camkit.report.bench.machine import package_version

    states = {"pictures of captures": "ready"}
    if missing := missing_bundles():
        cameras = ", ".join(missing)
        states[f"the cameras {cameras}"] = f"not installed: {install_bundles_text()}"
    installed_version = package_version("camkit-bundles")
    if installed_version not in {None, __version__}:
        states["the cameras of camkit-bundles"] = (
            f"of camkit {installed_version}, this is {__version__}: {install_bundles_text()}"
        )
    for purpose, (extra, modules) in PURPOSES.items():
        is_ready = not missing_packages(modules)
        states[purpose] = "ready" if is_ready else f"not installed: {install_text(extra)}"
    return states


def _openvino_state(missing: str | None) -> str:
    """Return in which numbers openvino computes networks here."""
    return "fp32, bf16" if missing is None else f"no bf16, which needs {missing}"


def _try_decoder() -> str:
    """Write a small DNG and read it back through the decoder's own process."""
    import numpy as np

    from camkit.runtime.output.dng import DngTags, write_bayer_dng
    from camkit.runtime.raw import read_capture

    mosaic = np.random.default_rng(0).integers(100, 1000, (64, 64), dtype=np.uint16)
    tags = DngTags(
        cfa="RGGB",
        black=64,
        white=1023,
        color_matrix=None,
        as_shot_neutral=(1.0, 1.0, 1.0),
        camera_model="camkit doctor",
    )
    with TemporaryDirectory() as folder:
        path = Path(folder) / "doctor.dng"
        try:
            write_bayer_dng(path, mosaic, tags=tags)
            capture = read_capture(path)
        except (CamkitError, OSError) as error:
            return f"fails: {error}"
    return "works" if np.array_equal(capture.samples, mosaic) else "gives wrong samples"
