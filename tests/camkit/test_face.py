"""`import camkit`: free of torch, loaded only when touched, and exactly these names."""

import subprocess
import sys
from pathlib import Path

import pytest

import camkit
from tests.bundle_factory import write_tiny_bundle

PUBLIC = [
    "BundleError",
    "CameraWords",
    "CamkitError",
    "Cancelled",
    "ContractError",
    "DecodeError",
    "FileResult",
    "MemoryCapError",
    "MosaicOptions",
    "ParityError",
    "Pipeline",
    "UnsupportedError",
    "ViewPage",
    "WorkerError",
    "WorkerPool",
    "__version__",
    "calibrate",
    "export",
    "freeze",
    "load",
    "make",
    "portable",
    "process",
    "recipe",
    "simulate",
    "train",
    "view",
]


def _fresh(code: str, *arguments: object) -> str:
    """Run code in a fresh process in which torch and onnxscript cannot be imported."""
    blocked = "import sys\nsys.modules['torch'] = None\nsys.modules['onnxscript'] = None\n"
    command = [sys.executable, "-c", blocked + code, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_the_public_names_are_these() -> None:
    assert camkit.__all__ == PUBLIC
    assert dir(camkit) == PUBLIC


def test_every_public_name_is_there() -> None:
    assert all(getattr(camkit, name) is not None for name in PUBLIC)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'sharpen'"):
        _ = camkit.sharpen  # type: ignore[attr-defined]


def test_importing_camkit_loads_nothing_heavy() -> None:
    loaded = _fresh("import camkit\nprint(*sys.modules)").split()
    assert not {"numpy", "cv2", "onnxruntime", "onnx", "rawpy", "pydantic"} & set(loaded)


def test_the_whole_face_works_where_torch_cannot_be_imported(tmp_path: Path) -> None:
    bundle = write_tiny_bundle(tmp_path)
    code = (
        "import camkit, numpy as np\n"
        "pipeline = camkit.load(sys.argv[1])\n"
        "image = pipeline.process_array(np.full((64, 96), 300, np.uint16), iso=100)\n"
        "assert callable(camkit.process) and sys.modules['torch'] is None\n"
        "print(image.shape)\n"
    )
    assert _fresh(code, bundle).strip() == "(3, 64, 96)"
