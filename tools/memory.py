"""Peak memory of `camkit process` against its cap, and seconds: sizes, formats, megapixels, jobs.

    python -m tools.memory --bundles duet,trio-edof --sizes S,M --formats exr --megapixels 24,100

The peak is the largest sum of proportional set sizes (PSS, so shared pages count once) over the
process and its children, sampled; seconds are those of the whole process. Captures are mosaics of
a small simulated one, bundles are stretched to the sensor that they need.
"""

import argparse
import itertools
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.bundle.haze_file import haze_from_bytes, haze_to_bytes
from camkit.bundle.optics import HAZE, PSF
from camkit.bundle.psf_file import psf_from_bytes, psf_to_bytes
from camkit.bundle.reader import STRESS_HAZE, STRESS_PSF, Bundle, find_bundle, open_bundle
from camkit.bundle.writer import write_bundle
from camkit.runtime.files.decoder import camkit_environment
from camkit.runtime.options import DEFAULT_MAX_MEM_BYTES, parse_memory
from camkit.runtime.twin.simulate import SimulationOptions, photograph, write_capture
from camkit.scenes import procedural_scene

POLL_S: Final = 0.03
CELL_PX: Final = (320, 480)


def main() -> None:
    """Print a table of peaks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bundles", default="duet,duet-joint,trio-edof")
    parser.add_argument("--sizes", default="S,M,L")
    parser.add_argument("--formats", default="exr")
    parser.add_argument("--megapixels", default="24")
    parser.add_argument("--jobs", default="1")
    parser.add_argument("--max-mem", help="cap; the default cap of every job without")
    parser.add_argument("options", nargs="*", help="further words for camkit process, behind --")
    arguments = parser.parse_args()
    print("| bundle | size | format | MP | jobs | s per file | cap MB | peak MB | peak / cap |")
    print("|---|---|---|---|---|---|---|---|---|")
    shares = []
    listed = (arguments.bundles, arguments.megapixels)
    for name, megapixels in itertools.product(*(text.split(",") for text in listed)):
        with tempfile.TemporaryDirectory() as folder:
            captures = Captures(Path(folder), name, float(megapixels))
            runs = (arguments.sizes, arguments.formats, arguments.jobs)
            for size, format_, jobs in itertools.product(*(text.split(",") for text in runs)):
                if size not in captures.sizes:
                    continue
                words = ["--size", size, "--format", format_, "--jobs", jobs, *arguments.options]
                cap = DEFAULT_MAX_MEM_BYTES * int(jobs) / 1e6
                if arguments.max_mem:
                    words += ["--max-mem", arguments.max_mem]
                    cap = parse_memory(arguments.max_mem) / 1e6
                files = 1 if jobs == "1" else 2 * int(jobs)
                began = time.perf_counter()
                peak = captures.peak_mb(words, files=files)
                each_s = (time.perf_counter() - began) / files
                shares.append(peak / cap)
                numbers = (f"{each_s:.1f}", f"{cap:.0f}", f"{peak:.0f}")
                cells = (name, size, format_, megapixels, jobs, *numbers)
                print(f"| {' | '.join(cells)} | {shares[-1]:.3f} |", flush=True)
    over_cap = sum(share > 1 for share in shares)
    print(
        f"{len(shares)} runs, {over_cap} above the cap; largest {max(shares):.3f} of it, "
        f"median {statistics.median(shares):.3f}"
    )


class Captures:
    """Large captures of a camera in a folder, all the same picture."""

    def __init__(self, folder: Path, name: str, megapixels: float) -> None:
        self._folder = folder
        bundle = open_bundle(find_bundle(name))
        height = round((megapixels * 1e6 / 1.5) ** 0.5 / 16) * 16
        width = height * 3 // 2
        extent = bundle.manifest.sensor.known_extent
        self._bundle: str | Path = name
        if (extent.width_px, extent.height_px) != (width, height):
            self._bundle = folder / f"{name}.camkit"
            write_stretched(bundle, self._bundle, width, height)
        large = open_bundle(find_bundle(str(self._bundle)))
        scene = procedural_scene(7, *CELL_PX)
        depth_mm = float(large.psf.depths_mm[0])
        small = photograph(scene, large, SimulationOptions(iso=100.0, depth_mm=depth_mm))
        repeats = (-(-height // CELL_PX[0]), -(-width // CELL_PX[1]))
        samples = np.tile(small.samples, repeats)[:height, :width]
        window = replace(small.window, origin_px=(0, 0))
        self.photo.parent.mkdir()
        write_capture(
            self.photo,
            replace(small, samples=np.ascontiguousarray(samples), window=window),
            large.manifest.sensor,
            large.manifest.name,
        )

    @property
    def photo(self) -> Path:
        """Return the capture."""
        return self._folder / "one" / "photo.dng"

    @property
    def bundle(self) -> str | Path:
        """Return name or path of the camera that it is of."""
        return self._bundle

    @property
    def sizes(self) -> tuple[str, ...]:
        """Return the sizes that the camera has."""
        return open_bundle(find_bundle(str(self._bundle))).manifest.sizes

    def peak_mb(self, words: list[str], *, files: int) -> float:
        """Process some copies and give the peak of the tree.

        Raises:
            SystemExit: If camkit fails.
        """
        with tempfile.TemporaryDirectory(dir=self._folder) as work:
            names = []
            for number in range(files):
                names.append(Path(work) / f"photo{number}.dng")
                names[-1].symlink_to(self.photo)
            command = [sys.executable, "-m", "camkit", "process", *map(str, names), *words]
            command += ["--bundle", str(self._bundle), "--out-dir", f"{work}/out"]
            with subprocess.Popen(
                command,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                env=camkit_environment(),
            ) as child:
                watch = PssWatch(child.pid)
                output = child.communicate()[0]
                peak = watch.stop()
            if child.returncode:
                raise SystemExit(f"{' '.join(command)}\n{output}")
            return peak


class PssWatch:
    """The largest PSS of a process and all its descendants, sampled, in MB."""

    def __init__(self, pid: int) -> None:
        self._pid = pid
        self._peak = 0.0
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._sample, daemon=True)
        self._thread.start()

    def stop(self) -> float:
        """End sampling and give the peak."""
        self._stopped.set()
        self._thread.join()
        return self._peak

    def _sample(self) -> None:
        while not self._stopped.wait(POLL_S):
            self._peak = max(self._peak, sum(map(pss_mb, process_tree(self._pid))))


def process_tree(pid: int) -> Iterator[int]:
    """Return a process and its descendants."""
    yield pid
    try:
        tasks = list(Path(f"/proc/{pid}/task").iterdir())
        texts = [(task / "children").read_text() for task in tasks]
    except OSError:
        return
    for word in " ".join(texts).split():
        yield from process_tree(int(word))


def pss_mb(pid: int) -> float:
    """Return the PSS of a process in MB; 0 for one that has ended."""
    try:
        text = Path(f"/proc/{pid}/smaps_rollup").read_text()
    except OSError:
        return 0.0
    words = text.partition("\nPss:")[2].split(maxsplit=1)
    return int(words[0]) * 1024 / 1e6 if words else 0.0


def write_stretched(bundle: Bundle, path: Path, width: int, height: int) -> None:
    """Write a bundle whose sensor has as many pixels over the same width in millimetres."""
    manifest = bundle.manifest
    extent = manifest.sensor.known_extent
    ratio = width / extent.width_px
    pitch_um = extent.pixel_pitch_um / ratio
    centre = extent.optical_centre_px
    stretched = extent.model_copy(
        update={
            "width_px": width,
            "height_px": height,
            "pixel_pitch_um": pitch_um,
            "optical_centre_px": centre and (centre[0] * ratio, centre[1] * ratio),
        }
    )
    changes: dict[str, Any] = {
        "sensor": manifest.sensor.model_copy(update={"extent": stretched}),
    }
    if manifest.optics is not None:
        changes["optics"] = manifest.optics.model_copy(update={"pixel_pitch_um": pitch_um})
    members = {name: bundle.member(name) for name in bundle.names}
    for name in members.keys() & {PSF, STRESS_PSF}:
        psf = psf_from_bytes(members[name])
        members[name] = psf_to_bytes(replace(psf, pixel_pitch_um=pitch_um))
    for name in members.keys() & {HAZE, STRESS_HAZE}:
        haze = haze_from_bytes(members[name])
        members[name] = haze_to_bytes(replace(haze, pixel_pitch_um=pitch_um))
    write_bundle(path, manifest.model_copy(update=changes), members)


if __name__ == "__main__":
    main()
