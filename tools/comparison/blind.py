"""Two bundles of a camera side by side in an order that nobody knows, to be judged by eye.

    python -m tools.comparison.blind --before OLD.camkit --after duet --data PICTURES -o out/blind
    python -m tools.comparison.blind --reveal out/blind

Every picture, a field of stars and a disc on black are photographed through a fabricated copy at
some place and ISO and restored by both; `NN.png` shows a part as one restored it, as the other did,
and as it should be. Write `NN: left`, `NN: right` or `NN: equal` a line into `votes.txt` beside
them; `--reveal` counts.
"""

import argparse
import json
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.reader import find_bundle, open_bundle
from camkit.colorimetry import encode_srgb
from camkit.contracts import FloatArray
from camkit.errors import ContractError
from camkit.report.fabricated_optics import fabricated_optics
from camkit.report.quality import FABRICATION_SEEDS, FIELD_SHARES, Shot, list_set, read_picture
from camkit.scenes.clean import night
from tools.comparison.photograph import bundle_restorer, photograph
from tools.comparison.rows import check_camera

SIDE_PX: Final = 256
ENLARGED: Final = 2
MOST_PX: Final = 1024
GAP_PX: Final = 8
ISOS: Final = (100.0, 1600.0)
NIGHTS: Final = 4
KEY, VOTES = "key.json", "votes.txt"
SIDES: Final = ("left", "right")


def main(words: Sequence[str] | None = None) -> None:
    """Make the pictures, or count the votes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--before", help="NAME or PATH")
    parser.add_argument("--after", help="NAME or PATH")
    parser.add_argument("--size", default="M")
    parser.add_argument("--data", type=Path, help="folder of sharp pictures")
    parser.add_argument("--pictures", type=int, help="the first of them by name")
    parser.add_argument("--seed", type=int, default=0, help="of the order, places and parts")
    parser.add_argument("--work-dir", type=Path, default=Path("runs/quality"), help="traced PSFs")
    parser.add_argument("-o", "--output", type=Path, help="folder of the pictures")
    parser.add_argument("--reveal", type=Path, help="count the votes of this folder")
    arguments = parser.parse_args(words)
    if arguments.reveal is not None:
        print(json.dumps(counted(arguments.reveal)))
        return
    if None in (arguments.before, arguments.after, arguments.data, arguments.output):
        parser.error("--before, --after, --data and --output are needed")
    make(arguments)


def make(arguments: argparse.Namespace) -> None:
    """Write the pictures and the key."""
    bundles = [open_bundle(find_bundle(name)) for name in (arguments.before, arguments.after)]
    check_camera(*bundles)
    restore = [bundle_restorer(bundle, size=arguments.size) for bundle in bundles]
    rng = np.random.default_rng(arguments.seed)

    @lru_cache
    def lens(copy: int) -> FrozenOptics:
        return fabricated_optics(bundles[1], copy, cache_folder=arguments.work_dir / "psf")

    arguments.output.mkdir(parents=True, exist_ok=True)
    key: dict[str, Any] = {}
    for number, (name, scene) in enumerate(_scenes(arguments, rng)):
        shot = Shot(
            set_name="blind",
            picture=Path(name),
            number=int(rng.integers(len(FABRICATION_SEEDS))),
            position=int(rng.integers(len(FIELD_SHARES))),
            iso=float(rng.choice(ISOS)),
            psf="fresh",
        )
        taken = photograph(shot, scene, bundles[1], lens(shot.fabrication_seed))
        order = rng.permutation(2)
        shown = [encode_srgb(restore[which](taken)) for which in order]
        at = [int(rng.integers(max(side - SIDE_PX, 1))) for side in taken.sharp.shape[1:]]
        _write(arguments.output / f"{number:02d}.png", [*shown, taken.sharp], (at[0], at[1]))
        key[f"{number:02d}"] = {
            "scene": name,
            "copy": shot.fabrication_seed,
            "position": shot.position,
            "iso": shot.iso,
            "left": ("before", "after")[order[0]],
        }
    (arguments.output / KEY).write_text(json.dumps(key, indent=1), encoding="utf-8")


def counted(folder: Path) -> dict[str, int]:
    """Return how often each was found better.

    Raises:
        ContractError: If a vote is none, or a picture has two or none.
    """
    key = json.loads((folder / KEY).read_text(encoding="utf-8"))
    found = {"before": 0, "after": 0, "equal": 0}
    waiting = set(key)
    for line in (folder / VOTES).read_text(encoding="utf-8").splitlines():
        name, _, vote = (word.strip() for word in line.partition(":"))
        if not line.strip():
            continue
        if name not in key or vote not in (*SIDES, "equal"):
            raise ContractError(
                f"a vote is NN: left, right or equal, of a picture in {folder.name}; got {line!r}"
            )
        if name not in waiting:
            raise ContractError(f"{name} has two votes")
        waiting.remove(name)
        left = key[name]["left"]
        right = "after" if left == "before" else "before"
        found[{"left": left, "right": right}.get(vote, vote)] += 1
    if waiting:
        raise ContractError(f"no vote for {', '.join(sorted(waiting))}")
    return found


def _scenes(
    arguments: argparse.Namespace, rng: np.random.Generator
) -> Iterator[tuple[str, FloatArray]]:
    for path in list_set(arguments.data, arguments.pictures):
        yield path.name, read_picture(path, MOST_PX)
    for number in range(NIGHTS):
        yield f"night {number}", night(rng, 2 * SIDE_PX)


def _write(path: Path, pictures: Sequence[FloatArray], at: tuple[int, int]) -> None:
    """Write parts of (3, h, w) sRGB pictures side by side, every pixel as a square of four."""
    parts = []
    for picture in pictures:
        part = picture[:, at[0] : at[0] + SIDE_PX, at[1] : at[1] + SIDE_PX]
        bgr = np.rint(np.clip(part[::-1], 0, 1) * 255).astype(np.uint8).transpose(1, 2, 0)
        large = bgr.repeat(ENLARGED, axis=0).repeat(ENLARGED, axis=1)
        parts += [large, np.full((large.shape[0], GAP_PX, 3), 255, np.uint8)]
    cv2.imwrite(str(path), np.concatenate(parts[:-1], axis=1))


if __name__ == "__main__":
    main()
