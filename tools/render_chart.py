"""Render by rays and by PSF maps: error against CPU seconds and bytes.

The duet looks at a plane 1 m away (for the rows of depths, at 0.8 m with the focus at 1 m); five
small windows over the field. The reference is the Monte-Carlo render with many samples; its noise
is estimated from its two halves and taken off the errors. Seconds are of one core
(`time.process_time`), so a busy machine changes them less than wall time. Bytes are the growth of
the peak resident size in a child process.

    python -m tools.render_chart [--out-dir out/render] [--reference-spp 4096] [--side-px 24]
"""

import argparse
import json
import math
import multiprocessing
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
import torch
from torch import Tensor

from camkit.models_def.optics.kernel_bank import gaussian_response, wavelength_grid
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.paraxial import paraxial_image, with_paraxial_focus
from camkit.models_def.optics.psf import with_object_distance
from camkit.models_def.optics.render.alignment import fit_alignment
from camkit.models_def.optics.render.monte_carlo import Sampling, render
from camkit.models_def.optics.render.optics import lens_optics
from camkit.models_def.optics.render.psf_map import MapGrid, map_at, render_by_map, trace_map
from camkit.models_def.optics.render.texture import Texture
from camkit.models_def.optics.render.window import Window, centred_window
from camkit.scenes import procedural_scene

FOCUS_MM, DEPTH_MM, PITCH_UM, KERNEL_PX = 1000.0, 800.0, 6.0, 65
HEIGHTS_MM: Final = (1.0, 5.0, 9.0, 13.0, 17.0)
WIDEST_MM: Final = 18.0
BLOCK_PX: Final = 12
RESPONSE = gaussian_response(wavelength_grid(33))
RAYS: Final = ((4, 1), (16, 1), (64, 1), (128, 1), (64, 4), (64, 10))
DEPTHS: Final = (2, 3, 4, 6)
MAP_RAYS: Final = 2048
FOCUSED = with_paraxial_focus(with_object_distance(find_lens("duet"), FOCUS_MM))


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """A map: depths, fields, wavelengths, samples per pixel."""

    depths_mm: tuple[float, ...] = (FOCUS_MM,)
    fields: int = 17
    waves: int = 17
    oversample: int = 1

    def grid(self) -> MapGrid:
        """Return the grid to trace."""
        return MapGrid(
            depths_mm=np.array(self.depths_mm),
            field_heights_mm=np.linspace(0, WIDEST_MM, self.fields),
            wavelengths_um=wavelength_grid(self.waves) if self.waves > 1 else np.array([0.54]),
            kernel_px=(KERNEL_PX - 1) * self.oversample + 1,
            pitch_um=PITCH_UM / self.oversample,
            rays=MAP_RAYS,
        )


MAPS: Final = (
    *(Choice(fields=n) for n in (2, 3, 5, 9, 17)),
    *(Choice(waves=n) for n in (1, 2, 3, 5, 9)),
    Choice(oversample=2),
)


def windows(side_px: int) -> list[Window]:
    """Return windows along a diagonal of the sensor."""
    share = np.array([0.6, 0.8])
    square = centred_window(side_px, side_px, PITCH_UM)
    return [
        replace(square, top_mm=float(h * share[0]), left_mm=float(h * share[1])) for h in HEIGHTS_MM
    ]


def textures(some: list[Window], depth_mm: float) -> list[Texture]:
    """Return a scene for each window, one sample to 1.5 pixels of the sensor."""
    scale = -1 / paraxial_image(FOCUSED).magnification * depth_mm / FOCUS_MM
    found = []
    for seed, window in enumerate(some):
        scene = torch.from_numpy(np.clip(procedural_scene(seed, 128, 128), 0, 1)).contiguous()
        pitch = 1.5 * window.pitch_mm
        middle = 64 - window.height_px / 3
        axis = (middle - window.top_mm / pitch, middle - window.left_mm / pitch)
        found.append(Texture(values=scene, pitch_mm=pitch * scale, axis_px=axis))
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """What is rendered: windows, and a texture for each at a depth."""

    depth_mm: float
    windows: list[Window]
    textures: list[Texture]


def subject(side_px: int, depth_mm: float) -> Subject:
    """Make the windows and textures of a depth."""
    some = windows(side_px)
    return Subject(depth_mm=depth_mm, windows=some, textures=textures(some, depth_mm))


def by_rays(seen: Subject, sampling: Sampling) -> Tensor:
    """Render all windows by rays."""
    optics = lens_optics(with_object_distance(FOCUSED, seen.depth_mm))
    pairs = zip(seen.textures, seen.windows, strict=True)
    return torch.stack([render(t, optics, RESPONSE, w, sampling) for t, w in pairs])


def untraced(seen: Subject, sampling: Sampling) -> tuple[Tensor, float]:
    """Render all windows by rays, which need no tracing beforehand."""
    return by_rays(seen, sampling), 0.0


def by_map(seen: Subject, choice: Choice) -> tuple[Tensor, float]:
    """Render all windows by a map; also give the CPU seconds of tracing lens and distortion."""
    began = time.process_time()
    traced = trace_map(FOCUSED, RESPONSE, choice.grid())
    lens = with_object_distance(FOCUSED, seen.depth_mm)
    widest = max(seen.windows, key=lambda window: window.radius_mm)
    alignment = fit_alignment(lens, widest)
    tracing_s = time.process_time() - began
    placed = map_at(traced, seen.depth_mm)
    pictures = [
        render_by_map(t, alignment, placed, w, step_px=BLOCK_PX)
        for t, w in zip(seen.textures, seen.windows, strict=True)
    ]
    return torch.stack(pictures), tracing_s


def resident(key: str) -> int:
    """Read a size of this process in bytes."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return 1024 * int(next(line for line in lines if line.startswith(key)).split()[1])


def measured(work: Callable[[], tuple[Tensor, float]]) -> tuple[Tensor, dict[str, float]]:
    """Run work in a child process: its picture, CPU seconds and bytes."""
    receiver, sender = multiprocessing.get_context("fork").Pipe(duplex=False)

    def child() -> None:
        torch.set_num_threads(1)
        before, began = resident("VmRSS"), time.process_time()
        picture, tracing_s = work()
        cpu_s = time.process_time() - began
        grown = resident("VmHWM") - before
        sender.send((picture.numpy(), cpu_s - tracing_s, tracing_s, grown))

    process = multiprocessing.get_context("fork").Process(target=child)
    process.start()
    picture, render_s, tracing_s, grown = receiver.recv()
    process.join()
    return torch.from_numpy(picture), {
        "render_cpu_s": render_s,
        "tracing_cpu_s": tracing_s,
        "peak_bytes": grown,
    }


def rms(difference: Tensor) -> float:
    """Return the root of the mean square."""
    return float(difference.square().mean().sqrt())


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """The picture that counts as right, and its noise."""

    picture: Tensor
    noise: float

    def error(self, picture: Tensor) -> float:
        """Return the RMS error; the noise of the reference, which is independent, is taken off."""
        return math.sqrt(max(0.0, rms(picture - self.picture) ** 2 - self.noise**2))


def reference_of(seen: Subject, spp: int) -> Reference:
    """Render by rays twice and take the mean."""
    passes = max(1, spp // 128)
    first, second = (by_rays(seen, Sampling(spp=64, passes=passes, seed=seed)) for seed in (10, 11))
    return Reference(picture=(first + second) / 2, noise=rms(first - second) / 2)


def rows_of_rays(seen: Subject, reference: Reference) -> list[dict[str, Any]]:
    """Measure renders by rays."""
    rows = []
    for spp, passes in RAYS:
        picture, cost = measured(partial(untraced, seen, Sampling(spp=spp, passes=passes, seed=1)))
        rows.append({"method": "rays", "spp": spp, "passes": passes, **cost})
        rows[-1]["error"] = reference.error(picture)
    return rows


def rows_of_maps(seen: Subject, reference: Reference) -> list[dict[str, Any]]:
    """Measure renders by maps: at the focus over fields and wavelengths, else over depths."""
    near, depth_mm = FOCUS_MM / 2, seen.depth_mm
    choices = [*MAPS]
    if depth_mm != FOCUS_MM:
        sets = [1 / np.linspace(1 / near, 1 / FOCUS_MM, n) for n in DEPTHS]
        choices = [Choice(), *(Choice(depths_mm=tuple(map(float, some))) for some in sets)]
        choices.append(Choice(depths_mm=(depth_mm,)))
    rows = []
    for choice in choices:
        picture, cost = measured(partial(by_map, seen, choice))
        row = {
            "method": "map",
            "depth_mm": depth_mm,
            "depths_mm": [round(d, 1) for d in choice.depths_mm],
            "fields": choice.fields,
            "wavelengths": choice.waves,
            "oversample": choice.oversample,
            **cost,
            "error": reference.error(picture),
        }
        rows.append(row)
    return rows


def draw(rows: list[dict[str, Any]], noise: float, path: Path) -> None:
    """Draw error against seconds, and against the samples of the map."""
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    rays = [r for r in rows if r["method"] == "rays"]
    maps = [r for r in rows if r["method"] == "map" and r["depth_mm"] == FOCUS_MM]
    left.loglog([r["render_cpu_s"] for r in rays], [r["error"] for r in rays], "o-", label="rays")
    for key, label in (("render_cpu_s", "map, traced already"), ("total", "map, with tracing")):
        seconds = [r.get(key, r["render_cpu_s"] + r["tracing_cpu_s"]) for r in maps]
        left.loglog(seconds, [r["error"] for r in maps], "s", label=label)
    left.axhline(noise, color="0.7", label="noise of the reference")
    left.set(xlabel="CPU seconds", ylabel="RMS error (1.0 = white)")
    series = {
        "fields": [(r["fields"], r["error"]) for r in maps if r["wavelengths"] == 17][:5],
        "wavelengths": [(r["wavelengths"], r["error"]) for r in maps if r["wavelengths"] < 17],
        "depths (0.8 m)": [
            (len(r["depths_mm"]), r["error"])
            for r in rows
            if r["method"] == "map" and r["depth_mm"] != FOCUS_MM
        ][:-1],
    }
    for label, points in series.items():
        right.loglog(*zip(*points, strict=True), "o-", label=label)
    right.set(xlabel="samples of the map", ylabel="RMS error (1.0 = white)")
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend()
    figure.savefig(path, dpi=120)


def main() -> None:
    """Measure, write the table and the chart."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out-dir", type=Path, default=Path("out/render"))
    parser.add_argument("--reference-spp", type=int, default=4096)
    parser.add_argument("--side-px", type=int, default=24)
    options = parser.parse_args()
    torch.set_num_threads(1)
    options.out_dir.mkdir(parents=True, exist_ok=True)
    rows: list[dict[str, Any]] = []
    noises = []
    for depth_mm in (FOCUS_MM, DEPTH_MM):
        seen = subject(options.side_px, depth_mm)
        reference = reference_of(seen, options.reference_spp)
        noises.append(reference.noise)
        if depth_mm == FOCUS_MM:
            rows += rows_of_rays(seen, reference)
        rows += rows_of_maps(seen, reference)
    pixels = len(HEIGHTS_MM) * options.side_px**2
    table = {"pixels": pixels, "reference_noise": noises, "rows": rows}
    (options.out_dir / "render.json").write_text(json.dumps(table, indent=1), encoding="utf-8")
    draw(rows, noises[0], options.out_dir / "render.png")
    for row in rows:
        print(json.dumps(row))
    print(f"reference noise {noises}, {time.process_time():.0f} CPU s without the children")


if __name__ == "__main__":
    main()
