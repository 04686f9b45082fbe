"""Real coded captures read back: what the solve reaches on them, and what it is held up by.

    python -m tools.hdr.coded_captures shared/data/hdr_coded -o docs/results/coded-captures.json

The folder holds `MeasuredPSF.npz` and one folder per scene (`coded_scene`). Each is calibrated,
its bracket merged and laid on the capture, the capture solved. Results are compared with the laid
bracket, 1.0 = white of the capture, in the `frame` without its border and in the box of its largest
`light`, where they are laid:

- `capture`, `bare`, `guess`: the capture as it is, the frame without plate of its exposure, the
  capture with lights guessed from the size of their blobs
- `solve`: with the measured PSF; `solve, PSF as stated`: before its background was taken off
- `simulated capture`, `simulated solve`: made of the laid bracket by the very PSF, clipped and
  rounded as the real one: what this code allows where nothing else is wrong
- `star capture`, `star solve`: the same for the core of this PSF and 6 % of the light in four lines
"""

import argparse
import json
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from camkit.colorimetry import encode_srgb
from camkit.contracts import FloatArray
from camkit.errors import CamkitError, DecodeError
from camkit.report.hdr_score import blob_guess, psnr_db
from camkit.scenes.saturation import CEILING
from tools.hdr.coded_judge import Box, Judge, Mask, Seen, light_by_start, simulated, star_psf
from tools.hdr.coded_optics import TURNS, cleaned_psf, explained, read_psf, seen_through
from tools.hdr.coded_registration import around_light, largest_light, lay, local_shifts
from tools.hdr.coded_scene import CODED, CodedScene, read_scene

PSF_FILE: Final = "MeasuredPSF.npz"
BORDER_PX: Final = 32
BOX_PX: Final = 48
STOPS: Final = (0, -2, -4)
SHOWN: Final = ("capture", "solve", "simulated solve", "star solve", "reference")


def main() -> None:
    """Measure every scene and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--out-dir", type=Path, help="for pictures at 0, -2, -4 EV")
    arguments = parser.parse_args()
    try:
        record = measure_folder(arguments.folder, arguments.out_dir)
    except CamkitError as error:
        raise SystemExit(str(error)) from error
    if arguments.output is not None:
        arguments.output.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def measure_folder(folder: Path, out_dir: Path | None) -> dict[str, Any]:
    """Measure the scenes of a folder, print a table of each, write its pictures where wanted.

    Raises:
        DecodeError: If it holds no scene, or one that cannot be read.
    """
    scenes = sorted({file.parent for file in folder.glob(f"*/{CODED}")})
    if not scenes:
        raise DecodeError(f"{folder}: expected folders in it with a {CODED} each; got none")
    stated = read_psf(folder / PSF_FILE)
    record: dict[str, Any] = {"psf": cleaned_psf(stated)[1], "scenes": {}}
    for scene in scenes:
        found, pictures = measure(read_scene(scene), stated)
        record["scenes"][scene.name] = found
        print(table(scene.name, found))
        if out_dir is not None:
            write_sheet(out_dir / f"{scene.name}.png", pictures)
    return record


def measure(scene: CodedScene, stated: FloatArray) -> tuple[dict[str, Any], dict[str, FloatArray]]:
    """Return the numbers of a scene, and pictures of its largest light by name."""
    where = around_light(scene.clipped)
    clean, _ = cleaned_psf(stated)
    turn, misfits = best_turn(scene, clean, where)
    psf, stated = TURNS[turn](clean), TURNS[turn](stated)
    expected = seen_through(scene.reference, psf)
    laid = lay(scene.capture, expected, where)
    reference = np.minimum(laid.on(scene.reference), np.float32(CEILING))
    told = explained(scene.capture, reference, psf, where)
    seen = Seen.of(scene.capture, scene.clipped, scene.levels)
    areas = areas_of(scene.clipped)
    judge = Judge(seen, reference, areas)
    judge.add("capture", seen.light)
    judge.add("bare", laid.on(scene.bare))
    judge.add("guess", blob_guess(seen.light, seen.clipped))
    recovery = judge.solve("solve", psf)
    judge.solve("solve, PSF as stated", stated)
    measured = {"solve": light_by_start(seen, psf)}
    for name, kernel in (("simulated", psf), ("star", star_psf(psf))):
        made = simulated(reference, kernel, scene.clipping_codes, scene.black_offset)
        judge.add(f"{name} capture", made.light, made)
        judge.solve(f"{name} solve", kernel, made)
        measured[f"{name} solve"] = light_by_start(made, kernel)
    facts = {
        "calibration": scene.facts,
        "clipped_share": _rounded(scene.clipped.mean(axis=(1, 2))),
        "reference_peak": _rounded(reference.max(axis=(1, 2))),
        "orientation": {"taken": turn, "misfit": misfits},
        "laid": laid.to_json(),
        "local_shifts_px": local_shifts(scene.capture, expected, scene.clipped),
        "explained": told | against_model(scene, seen_through(reference, psf), where),
        "recovery": recovery.to_json(),
        "light_from_a_tenth_of_the_start": measured,
        "scores": judge.scores,
    }
    shown = judge.pictures | {"reference": reference}
    return facts, {name: shown[name][areas["light"]] for name in SHOWN}


def best_turn(scene: CodedScene, psf: FloatArray, where: Mask) -> tuple[str, dict[str, float]]:
    """Return the way to hold a PSF with which the reference explains a capture best.

    Returns:
        Its name, and the misfit of every way, the factors of the PSF's parts being free.
    """
    misfits = {}
    for name, turn in TURNS.items():
        held = turn(psf)
        laid = lay(scene.capture, seen_through(scene.reference, held), where)
        told = explained(scene.capture, laid.on(scene.reference), held, where)
        misfits[name] = round(float(np.mean(told["misfit"])), 4)
    return min(misfits, key=lambda name: misfits[name]), misfits


def areas_of(clipped: Mask) -> dict[str, Box]:
    """Return the frame without its border, and the box of its largest light within."""
    light, sides = largest_light(clipped), []
    for axis in (1, 0):
        line = np.asarray(light.any(axis=axis))
        inside = np.flatnonzero(line)
        first = max(int(inside[0]) - BOX_PX, BORDER_PX)
        sides.append(slice(first, min(int(inside[-1]) + BOX_PX + 1, line.size - BORDER_PX)))
    border = slice(BORDER_PX, -BORDER_PX)
    return {"frame": (slice(None), border, border), "light": (slice(None), sides[0], sides[1])}


def against_model(scene: CodedScene, expected: FloatArray, where: Mask) -> dict[str, Any]:
    """Compare a capture with what is expected of it, clipped at white, near its light."""
    seen, told = (np.clip(light, 0, 1)[:, where] for light in (scene.capture, expected))
    gap = float(np.mean(np.square(seen - told, dtype=np.float64)))
    return {
        "psnr_db": round(psnr_db(gap), 2),
        "clipped_share_expected": _rounded((expected >= 1).mean(axis=(1, 2))),
    }


def table(name: str, found: dict[str, Any]) -> str:
    """Return the scores of a scene as a table."""
    lines = [f"\n{name}: reference up to {found['reference_peak']} of white (red, green, blue)"]
    for area, rows in found["scores"].items():
        names = list(next(iter(rows.values())))
        lines += [f"| {area} | {' | '.join(names)} |", "|---" * (len(names) + 1) + "|"]
        lines += [
            f"| {row} | {' | '.join(str(scores.get(n, '')) for n in names)} |"
            for row, scores in rows.items()
        ]
    return "\n".join(lines)


def write_sheet(path: Path, pictures: dict[str, FloatArray]) -> None:
    """Write pictures side by side, one row for each exposure."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [
        np.concatenate([encode_srgb(p * np.float32(2.0**ev)) for p in pictures.values()], axis=2)
        for ev in STOPS
    ]
    pixels = (np.clip(np.concatenate(rows, axis=1), 0, 1) * 255 + 0.5).astype(np.uint8)
    if not cv2.imwrite(str(path), pixels.transpose(1, 2, 0)[..., ::-1]):
        raise OSError(f"cannot write {path}")
    print(f"{path}: columns {', '.join(pictures)}; rows {STOPS} EV")


def _rounded(values: FloatArray) -> list[float]:
    return [round(float(v), 4) for v in values]


if __name__ == "__main__":
    main()
