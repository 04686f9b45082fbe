"""A joint design of two steps, and the tools of the repository run on it."""

import importlib

import pytest

RECIPE = """
name = "tiny"
prescription = "duet"
optics = { half_field_deg = 12.0, fields = 2, pupil_rays = 24, efl_mm = 50.0, solved_surface = 4 }
pixels = { pitch_um = 6.0, kernel_px = 33 }
loss = { kind = "log_mse" }
data = { procedural_scenes = 1, scene_px = 160 }
vary = [
    { kind = "curvature", surface = 1, low = -0.1, high = 0.1 },
    { kind = "conic", surface = 4, low = -4.0, high = 4.0 },
    { kind = "defocus", low = -2.0, high = 2.0 },
]

[schedule]
steps = 2
batch = 1
patch_px = 24
epoch_steps = 2
valid_steps = 2
valid_patches = 1
"""


def run_tool(monkeypatch: pytest.MonkeyPatch, name: str, *arguments: object) -> int:
    """Call `main` of tools/NAME.py with arguments; give its exit code."""
    module = importlib.import_module(f"tools.{name}")
    monkeypatch.setattr("sys.argv", [name, *map(str, arguments)])
    return int(module.main() or 0)
