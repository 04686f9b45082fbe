"""Small captures of every built-in bundle, simulated by a checkout from fixed seeds.

photo   a photograph in the middle of the sensor, ISO 100
crop    another with an odd number of columns, far from the axis, ISO 1600
night   a night of which 1.5 % saturate, ISO 400
counts  photons of a picture
frames  three pictures of photons, the last one empty
scan    a gate scan of surfaces
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from tools.evidence.checkout import HERE, Checkout
from tools.evidence.samples import file_samples
from tools.evidence.scrubbed import printed_values

SCENES: Final = HERE / "tools" / "scenes"
SURFACES: Final = "surfaces.npz"
PHOTOGRAPHS: Final[dict[str, tuple[str, ...]]] = {
    "photo": (str(SCENES / "coffee.png"), "--seed", "1"),
    "crop": (
        *(str(SCENES / "chelsea.png"), "--iso", "1600", "--seed", "2"),
        *("--origin-px", "4100,2900"),
    ),
    "night": ("night:8", "--size-px", "512,384", "--saturate", "0.015", "--iso", "400"),
}
PHOTONS: Final[dict[str, tuple[str, ...]]] = {
    "counts": ("procedural:3", "--photons", "3000"),
    "scan": (SURFACES, "--photons", "300", "--sbr", "3"),
}
HOSTS: Final = {
    **{("deglare", name): "duet" for name in PHOTOGRAPHS},
    ("spad-sr-baselines", "scan"): "spad-sr",
}
"""(bundle, capture) -> the camera that takes it, where the bundle simulates none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Capture:
    """A capture of a bundle.

    Attributes:
        name: As above.
        path: Its file.
        is_photograph: Whether a picture becomes of it.
        options: Of `camkit.load`, without which the bundle refuses it.
    """

    name: str
    path: Path
    is_photograph: bool = True
    options: dict[str, Any]


def simulate_captures(checkout: Checkout, bundle: str) -> tuple[list[Capture], dict[str, Any]]:
    """Simulate the captures of a bundle into the checkout's folder of work.

    Returns:
        The captures, and the entries of a record about them.
    """
    is_photograph = checkout.manifest(bundle)["kind"] != "spad"
    _write_surfaces(checkout.work / SURFACES)
    captures, entries = [], {}
    for name, words in (PHOTOGRAPHS if is_photograph else PHOTONS).items():
        camera = HOSTS.get((bundle, name), bundle)
        path = checkout.work / f"{bundle}-{name}{'.dng' if is_photograph else '.npz'}"
        line = ["simulate", *words, "--bundle", camera, "--out", path.name, "--json"]
        process, seconds = checkout.command(line)
        options = {"force_bundle": True} if is_photograph and camera != bundle else {}
        captures.append(Capture(name=name, path=path, is_photograph=is_photograph, options=options))
        samples = file_samples(path) if path.exists() else None
        values = printed_values(process, checkout.folders)
        entries[f"{bundle} {name} simulate"] = {**values, "samples": samples, "seconds": seconds}
    if not is_photograph:
        frames = checkout.work / f"{bundle}-frames.npz"
        _write_frames(captures[0].path, frames)
        captures.append(Capture(name="frames", path=frames, is_photograph=False, options={}))
    return captures, entries


def _write_surfaces(path: Path) -> None:
    """Write a scene of photons: a slope with a box before it, chequered."""
    y, x = np.mgrid[:128, :256]
    depth_m = np.where((y >= 40) & (y < 90) & (x >= 80) & (x < 160), 0.12, 0.2 + x / 5120)
    albedo = 0.4 + 0.5 * ((x // 16 + y // 16) % 2)
    np.savez(path, depth_m=depth_m.astype(np.float32), albedo=albedo.astype(np.float32))


def _write_frames(counts: Path, path: Path) -> None:
    """Write frames of counts: a picture, the same moved, and an empty one."""
    with np.load(counts) as stored:
        arrays = dict(stored)
    picture = arrays["counts"]
    arrays["counts"] = np.stack([picture, np.roll(picture, 5, axis=1), np.zeros_like(picture)])
    np.savez(path, **arrays)
