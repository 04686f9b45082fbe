"""A small design: the conics of a known doublet, seen at three fields."""

from typing import Any


def small_design() -> dict[str, Any]:
    """Give its recipe as a table."""
    vary = [
        {"kind": "conic", "surface": 2, "low": -4.0, "high": 4.0},
        {"kind": "conic", "surface": 4, "low": -4.0, "high": 4.0},
        {"kind": "defocus", "low": -1.0, "high": 1.0},
    ]
    return {
        "name": "small",
        "prescription": "duet",
        "vary": vary,
        "optics": {"half_field_deg": 12.0, "fields": 3, "pupil_rays": 48},
        "limits": {"min_edge_mm": 1.0},
        "pixels": {"pitch_um": 6.0, "kernel_px": 33, "noise": 0.01},
        "front": {"kind": "none"},
        "network": {"name": "trimmed_unet", "config": {"in_channels": 3, "widths": [4, 4, 4]}},
        "loss": {"kind": "l1"},
        "schedule": {
            "steps": 6,
            "batch": 2,
            "patch_px": 24,
            "lens_rate": 0.05,
            "network_rate": 1e-3,
            "hold_steps": 1,
            "freeze_share": 0.0,
            "valid_steps": 3,
            "valid_patches": 2,
        },
        "data": {"procedural_scenes": 2, "scene_px": 96},
    }
