"""Where the optional real test data lie; tests that need them skip with a message."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def data_path(relative: str) -> Path:
    """Give a file or folder of the data set, or skip the test."""
    folder = Path(os.environ.get("CAMKIT_DATA", ROOT.parent / "shared" / "data"))
    path = folder / relative
    if not path.exists():
        pytest.skip(f"{relative} is not there; set CAMKIT_DATA to the data folder to run this test")
    return path
