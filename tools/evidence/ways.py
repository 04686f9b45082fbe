"""The options by which captures are processed: every method, and what else changes a walk."""

from typing import Any, Final

Options = dict[str, Any]

METHODS: Final = ("net", "wiener", "rl", "admm-tv", "haze", "physics", "deglare", "develop")
METHODS_OF_PHOTONS: Final = ("log", "lsq", "net", "linear")
PRODUCTS: Final = ("depth", "intensity", "transient", "lifetime")
PHOTOGRAPHS: Final[tuple[Options, ...]] = (
    {},
    *({"method": method} for method in METHODS),
    {"size": "S"},
)
"""Of every photograph."""
FIRST_PHOTOGRAPH: Final[tuple[Options, ...]] = (
    *({"quality": quality} for quality in ("best", "adaptive", "draft")),
    {"mode": "fast"},
    {"mode": "whole"},
    {"tile_px": 128},
    {"color": "acescg", "exposure_ev": 1.0, "white_balance": (1.5, 1.0, 2.0)},
    {"color": "camera", "vignetting": False, "undistort": False},
    {"demosaic": "quality", "strength": 0.5, "laws": "enforce"},
    {"depth_m": 1.0, "on_unsafe": "fallback"},
    {"dtype": "fp16"},
)
"""Of the first photograph of a bundle, besides."""
PHOTONS: Final[tuple[Options, ...]] = (
    {},
    *({"method": method} for method in METHODS_OF_PHOTONS),
    *({"product": product} for product in PRODUCTS),
    {"size": "S"},
    {"returns": "2"},
    {"pool": "3"},
)
"""Of every capture of photons."""


def way_name(options: Options) -> str:
    """Return the options of a way as one word."""
    return ",".join(f"{name}={value}" for name, value in options.items()) or "default"
