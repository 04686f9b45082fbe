"""Measure readers of portable cameras: `python -m examples.measure_readers BUNDLE... -o FILE.json`.

Golden cases of each bundle and size go through C++, node, node with WebAssembly, and the page in
Chromium on one thread. Decibels are to the reader in Python; their peak is white or the brightest
light. Times are of a simulated capture of 1500x1000 pixels at ISO 400, all readers one after the
other in each round: CPU seconds of camkit, Python, C++ and node, seconds of WebAssembly and the
page, whose compiler works beside them. Run from the root of the repository, in the environment of
the tests.
"""

import argparse
import base64
import json
import re
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

import camkit
from camkit.arrays import FloatArray
from camkit.bundle.reader import find_bundle, open_bundle
from camkit.runtime.kind import part_of
from camkit.runtime.raw import read_capture
from camkit.runtime.twin.simulate import SimulationOptions
from camkit.scenes import procedural_scene
from tests.chromium import Page, chromium
from tests.examples.built_examples import PAGE, PROGRAMS, build_examples
from tests.examples.portable_cases import (
    PortableCamera,
    difference_db,
    make_camera,
    write_photo,
)
from tests.examples.test_browser import DONE, LIGHT, READY, SHOWN
from tests.examples.test_cpp import cpp_program, read_pfm

ROUNDS = 3


def run_node(camera: PortableCamera, photo: Path, size: str, *flags: str) -> tuple[FloatArray, str]:
    """Return light, and what the program says."""
    light = photo.with_suffix(".light")
    program = ["node", str(PROGRAMS / "develop.mjs"), str(camera.archive), str(photo)]
    words = [
        *program,
        str(photo.with_suffix(".png")),
        "--size",
        size,
        "--light",
        str(light),
        "--overwrite",
        *flags,
    ]
    said = subprocess.run(words, check=True, capture_output=True, text=True).stdout
    width, height = map(int, re.findall(r"\d+", said)[:2])
    return np.fromfile(light, np.float32).reshape(3, height, width), said


def run_cpp(camera: PortableCamera, photo: Path, size: str) -> tuple[FloatArray, str]:
    """Return light, and what the program says."""
    capture = read_capture(photo, isolate=False)
    mosaic, light = photo.with_suffix(".npy"), photo.with_suffix(".pfm")
    np.save(mosaic, np.asarray(capture.samples, np.uint16))
    gains, origin = capture.white_balance or (1.0, 1.0, 1.0), capture.origin_px or (0, 0)
    words = [str(cpp_program()), str(camera.folder), "--size", size, "--iso", repr(capture.iso)]
    words += ["--white-balance", ",".join(map(repr, map(float, gains)))]
    words += ["--origin-px", ",".join(map(str, origin)), str(mosaic), str(light)]
    said = subprocess.run(words, check=True, capture_output=True, text=True).stdout
    return read_pfm(light), said.rpartition(", ")[2]


def run_page(page: Page, photo: Path) -> tuple[FloatArray, str]:
    """Return light, and what the page says."""
    page.value("document.querySelector('#photo').textContent = ''")
    page.choose("#files", photo)
    page.wait(f"document.querySelector('#photo').textContent.startsWith('{photo.name}')")
    page.value("document.querySelector('#develop').click()")
    page.wait(DONE, 300)
    said = page.value("document.querySelector('#news').textContent")
    page.wait(SHOWN)
    height, width, text = page.value(LIGHT)
    return np.frombuffer(base64.b64decode(text), np.float32).reshape(3, height, width), said


def golden_rows(camera: PortableCamera, run: Callable[[Path], tuple[FloatArray, str]]) -> list[Any]:
    """Return what a reader makes of the golden cases."""
    rows = []
    for name, case in camera.cases.items():
        light, _ = run(case.photo)
        row: dict[str, Any] = {
            "case": name,
            "to_python_db": round(difference_db(light, case.light), 1),
        }
        row["same_bits"] = bool(np.array_equal(light, case.light))
        if case.output is not None:
            most = float(np.abs(light - case.output).max())
            row |= {"difference": most, "allowed": case.allowed, "is_met": most <= case.allowed}
        rows.append(row)
    return rows


def simulated(path: str, folder: Path) -> Path:
    """Write a capture off the axis as DNG."""
    bundle = open_bundle(find_bundle(path))
    options = SimulationOptions(iso=400.0, seed=7, origin_px=(4300, 2800), exposure=0.25, scale=1)
    scene, photo = procedural_scene(7, 1000, 1500), folder / "large.dng"
    made = part_of(bundle.manifest).simulate(scene, bundle, options)
    write_photo(photo, bundle, made.samples, 400.0, made.white_balance, (4300, 2800))
    return photo


def measured(path: str, size: str, folder: Path, is_timed: bool) -> dict[str, Any]:
    """Return the numbers of one bundle and size."""
    camera = make_camera(path, size, folder)
    with chromium(folder / "..") as page:
        page.open(PAGE.as_uri())
        page.wait(READY)
        page.choose("#files", camera.archive)
        page.wait("document.querySelector('#camera').textContent !== 'none yet'")
        readers: dict[str, Callable[[Path], tuple[FloatArray, str]]] = {
            "C++": lambda photo: run_cpp(camera, photo, size),
            "node": lambda photo: run_node(camera, photo, size),
            "node, WebAssembly": lambda photo: run_node(camera, photo, size, "--wasm"),
            "page, one thread": lambda photo: run_page(page, photo),
        }
        rows = {name: golden_rows(camera, run) for name, run in readers.items()}
        times = timed(camera, readers, simulated(path, folder), path, size) if is_timed else {}
    manifest = open_bundle(find_bundle(path)).manifest
    return {
        "bundle": f"{manifest.name} {manifest.version}",
        "size": size,
        "golden": rows,
        "large": times,
    }


def timed(
    camera: PortableCamera, readers: dict[str, Any], photo: Path, path: str, size: str
) -> dict[str, Any]:
    """Return seconds of a large capture; of the page, its first and later ones."""
    seconds: dict[str, list[float]] = {}
    pipeline = camkit.load(path, size=size, threads=1)
    for _ in range(ROUNDS):
        cpu = time.process_time()
        own = pipeline.process(photo).image
        seconds.setdefault("camkit_cpu", []).append(time.process_time() - cpu)
        start, cpu = time.perf_counter(), time.process_time()
        light = camera.develop(photo)
        seconds.setdefault("python_cpu", []).append(time.process_time() - cpu)
        seconds.setdefault("python", []).append(time.perf_counter() - start)
        seconds.setdefault("python to camkit, dB", []).append(difference_db(light, own))
        for name, run in readers.items():
            made, said = run(photo)
            for unit, kind in (("s", ""), ("CPU s", ", CPU")):
                for number in re.findall(rf"([\d.]+) {unit}\b", said):
                    seconds.setdefault(f"{name}{kind}", []).append(float(number))
            seconds.setdefault(f"{name}, dB", []).append(difference_db(made, light))
    return {
        name: [round(n, 2) for n in each] + [round(median(each), 2)]
        for name, each in seconds.items()
    }


def main() -> None:
    """Measure what the command line names."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("bundles", nargs="+")
    parser.add_argument("--sizes", default="S,M")
    parser.add_argument("--timed", default="S", help="sizes whose time is measured")
    parser.add_argument("-o", "--out", type=Path, required=True)
    arguments = parser.parse_args()
    build_examples()
    rows = []
    for path in arguments.bundles:
        for size in arguments.sizes.split(","):
            with tempfile.TemporaryDirectory() as folder:
                inner = Path(folder) / "files"
                inner.mkdir()
                rows.append(measured(path, size, inner, size in arguments.timed.split(",")))
    document = {
        "command": "python -m examples.measure_readers BUNDLE... -o FILE.json",
        "machine": "2 cores of an AMD EPYC, other work beside",
        "times": "three rounds, then their median; seconds, or decibels to the reader in Python",
        "rows": rows,
    }
    arguments.out.write_text(json.dumps(document, indent=1) + "\n")


if __name__ == "__main__":
    main()
