"""Read lens files of others and put what camkit finds beside optiland's own trace.

    python -m tools.comparison.lens_files FOLDER [FOLDER ...] [--optiland PYTHON] [--json OUT]

Prints a row for every .zmx and .json: read, refused (and why), or read with fields that no chief
ray reaches. Of a lens that is read it prints the focal length, the paraxial back focal length, the
RMS spot on the axis and where the chief ray of the last field lands. With `--optiland`, the
interpreter of an environment that has optiland, each row has optiland's numbers for the file as
camkit writes it in JSON (`json`), as camkit writes it in .zmx (`zmx`), and for the file itself by
optiland's own reader (`own`).
"""

import argparse
import json
import subprocess
import tempfile
from collections import Counter
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import torch

from camkit.errors import CamkitError
from camkit.models_def.optics.aiming.field import field_slope
from camkit.models_def.optics.lens_file.lens_file import read_noted_lens, write_lens
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import hexapolar
from camkit.models_def.optics.spot import chief_heights, rms_radius, trace_spots

SUFFIXES: Final = (".zmx", ".json")
CHIEF: Final = "chief ray"
RINGS: Final = 6
WORKER: Final = Path(__file__).with_name("optiland_worker.py")
_WIDTH: Final = 90


@dataclass(frozen=True, slots=True, kw_only=True)
class FileFacts:
    """A file: read or refused, and the numbers of its lens.

    Attributes:
        file: Its folder and name.
        state: read, chief ray, or the name of the error.
        text: Notes, or the error.
        efl_mm: Focal length at the reference wavelength; None where there is no lens.
        bfl_mm: From the last vertex to the paraxial focus.
        spot_um: RMS radius about the centroid on the axis; None where no ray arrives.
        chief_mm: Distance from the axis at which the chief ray of the last field lands.
    """

    file: str
    state: str
    text: str
    efl_mm: float | None = None
    bfl_mm: float | None = None
    spot_um: float | None = None
    chief_mm: float | None = None


def lens_paths(folders: list[Path]) -> list[Path]:
    """Return the lens files of folders (and files among them), each folder in order."""
    return [
        path
        for folder in folders
        for path in (sorted(folder.iterdir()) if folder.is_dir() else [folder])
        if path.suffix.lower() in SUFFIXES
    ]


def measure_file(path: Path) -> tuple[FileFacts, Lens | None]:
    """Read a file and measure its lens on the axis."""
    name = f"{path.parent.name}/{path.name}"
    try:
        lens, notes = read_noted_lens(path)
    except CamkitError as error:
        state = CHIEF if CHIEF in str(error) else type(error).__name__
        return FileFacts(file=name, state=state, text=str(error)), None
    facts = FileFacts(file=name, state="read", text="; ".join(notes))
    try:
        data = paraxial_data(lens)
        facts = replace(facts, efl_mm=data.efl_mm, bfl_mm=data.bfl_mm)
        return replace(facts, spot_um=spot_um(lens), chief_mm=chief_mm(lens)), lens
    except CamkitError as error:
        return replace(facts, text=f"{facts.text}; not measured: {error}"), lens


def spot_um(lens: Lens) -> float:
    """Return the RMS radius of the spot on the axis about its centroid, reference wavelength."""
    axis = torch.zeros(1, dtype=torch.float64)
    wave = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    with torch.no_grad():
        spots = trace_spots(lens, axis, wave, hexapolar(RINGS), definition="paraxial")
    return 1000 * float(rms_radius(spots).flatten()[0])


def chief_mm(lens: Lens) -> float:
    """Return how far from the axis the chief ray of the last field lands, reference wavelength."""
    slope = field_slope(torch.tensor(lens.field_angles_rad[-1:], dtype=torch.float64))
    return abs(float(chief_heights(lens, slope)[0]))


def optiland_facts(paths: list[Path], python: Path) -> list[dict[str, Any]]:
    """Return what optiland finds in each file, or its error.

    Raises:
        OSError: If there is no such interpreter.
    """
    if not paths:
        return []
    command = [str(python), str(WORKER), *map(str, paths)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=Path.home())
    rows = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    missing = {"error": "optiland could not be started: is it installed there?"}
    return [*rows, *[missing] * (len(paths) - len(rows))]


def beside_optiland(
    lenses: list[tuple[Path, Lens]], python: Path
) -> dict[Path, dict[str, dict[str, Any]]]:
    """Return optiland's numbers of lenses by the ways that their files take to it."""
    with tempfile.TemporaryDirectory() as folder:
        ways: list[tuple[Path, str, Path]] = []
        for number, (path, lens) in enumerate(lenses):
            for suffix in SUFFIXES:
                out = Path(folder) / f"{number}{suffix}"
                try:
                    write_lens(lens, out)
                except CamkitError:
                    continue
                ways.append((path, suffix[1:], out))
            ways.append((path, "own", path.resolve()))
        results = optiland_facts([out for _, _, out in ways], python)
    table: dict[Path, dict[str, dict[str, Any]]] = {path: {} for path, _ in lenses}
    for (path, way, _), result in zip(ways, results, strict=True):
        table[path][way] = result
    return table


def row_text(facts: FileFacts, others: dict[str, dict[str, Any]]) -> str:
    """Return the line of a file."""
    if facts.efl_mm is None:
        return f"{facts.file}: {facts.state}: {facts.text[:_WIDTH]}"
    spot = "none" if facts.spot_um is None else f"{facts.spot_um:.5g} um"
    text = f"{facts.file}: read; EFL {facts.efl_mm:.6g}, BFL {facts.bfl_mm:.6g} mm, spot {spot}"
    text += f", chief {_number(facts.chief_mm)} mm"
    for way, other in others.items():
        if "error" in other:
            text += f"; {way}: {other['error'][:_WIDTH]}"
        else:
            text += f"; {way}: EFL {other['efl_mm']:.6g}, spot {other['spot_um']:.5g} um"
            text += f", chief {_number(other['chief_mm'])} mm"
    return text


def _number(value: float | None) -> str:
    return "none" if value is None else f"{value:.7g}"


def main() -> None:
    """Print the table and the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--optiland", type=Path, help="interpreter that has optiland")
    parser.add_argument("--json", type=Path, help="file for all numbers")
    arguments = parser.parse_args()
    measured = [(path, *measure_file(path)) for path in lens_paths(arguments.folders)]
    others: dict[Path, dict[str, dict[str, Any]]] = {}
    if arguments.optiland is None:
        print("without --optiland: no numbers of another program")
    else:
        read = [(path, lens) for path, _, lens in measured if lens is not None]
        others = beside_optiland(read, arguments.optiland)
    for path, facts, _ in measured:
        print(row_text(facts, others.get(path, {})))
    counts = Counter(facts.state for _, facts, _ in measured)
    print(", ".join(f"{state}: {count}" for state, count in counts.most_common()))
    if arguments.json is not None:
        rows = [asdict(facts) | {"optiland": others.get(path, {})} for path, facts, _ in measured]
        arguments.json.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
