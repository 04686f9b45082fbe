"""How bright clipped lamps are, told by the streaks of a windshield (Sun 2021, section 5.7.2).

    python -m tools.hdr.glare_lights -o docs/results/glare-lights.json

Night scenes behind a two-point star, linear, 12 bits with noise, as `glare_table` photographs
them; the solve of snapshot HDR reads the lamps from the star. A plate's PSF is known; of a
windshield the angle is found by the picture, how streaks fade and the share of light that they
hold is assumed:

- `capture`, `deglared`: as it is; streaks taken away, lamps left as they clipped
- `all known`: the star of the simulation
- `angle found`: its angle as `deglare` finds it; `both`: those lamps in the deglared picture
- `share doubled`: streaks taken for twice the light that they hold

Means are over the scenes in which an angle is found.
"""

import argparse
import json
import math
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.contracts import FloatArray
from camkit.report.hdr_score import Reference, hdr_scores
from camkit.scenes.saturation import CEILING
from tools.hdr.coded_judge import Seen, solved
from tools.hdr.glare_table import ANGLES_DEG, SIDES_PX, deglared
from tools.hdr.glare_twin import REACH_PX, SHARE, exposed_scene, photographed, two_point_star

SEEDS: Final = tuple(range(8))
LEVEL: Final = 0.99
NUMBERS: Final = ("hdr_psnr_db", "stops_rmse", "stops_rmse_aligned", "unclipped_psnr_db")


def main() -> None:
    """Print the means."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--seeds", type=int, nargs="+", default=SEEDS)
    arguments = parser.parse_args()
    found = {f"night:{seed}": measured(seed) for seed in arguments.seeds}
    print(f"| mean | scenes | {' | '.join(NUMBERS)} |\n{'|---' * (len(NUMBERS) + 2)}|")
    means = mean_scores(found)
    for way, scores in means.items():
        print(f"| {way} | {' | '.join(str(value) for value in scores.values())} |")
    if arguments.output is not None:
        record = {"scenes": found, "means": means}
        arguments.output.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def measured(seed: int) -> dict[str, Any]:
    """Return the angle of a scene's star, the one that is found, and the scores of each way."""
    angle_deg = ANGLES_DEG[seed % len(ANGLES_DEG)]
    scene = np.minimum(exposed_scene(f"night:{seed}", *SIDES_PX), np.float32(CEILING))
    capture = photographed(scene, two_point_star(math.radians(angle_deg)), seed).seen
    seen = Seen.of(capture, capture >= LEVEL, np.ones(3, np.float32))
    glare, cleared = deglared(capture)
    ways = {"capture": capture, "deglared": cleared, "all known": lit(seen, angle_deg, SHARE)}
    found_deg = glare.to_json()["angle_deg"]
    if found_deg is not None:
        ways["angle found"] = lit(seen, found_deg, SHARE)
        ways["both"] = np.where(seen.clipped, ways["angle found"], cleared)
        ways["share doubled"] = lit(seen, found_deg, 2 * SHARE)
    reference = Reference(truth=scene, clipped=seen.clipped)
    scores = {way: hdr_scores(picture, reference) for way, picture in ways.items()}
    return {
        "angle_deg": angle_deg,
        "found_deg": found_deg,
        "scores": {
            way: {name: round(one[name], 2) for name in NUMBERS} for way, one in scores.items()
        },
    }


def lit(seen: Seen, angle_deg: float, share: float) -> FloatArray:
    """Return a capture with its lamps, read from a star of that angle and share of light."""
    kernel = two_point_star(math.radians(angle_deg), share=share).dense()[0, 0]
    picture, _ = solved(seen, np.stack([kernel] * 3).astype(np.float32), REACH_PX)
    return picture


def mean_scores(found: dict[str, dict[str, Any]]) -> dict[str, dict[str, float]]:
    """Return the means of every way over the scenes in which an angle was found."""
    told = [scene["scores"] for scene in found.values() if scene["found_deg"] is not None]
    ways = list(told[0]) if told else []
    return {
        way: {"scenes": len(told)}
        | {
            name: round(float(np.mean([scores[way][name] for scores in told])), 2)
            for name in NUMBERS
        }
        for way in ways
    }


if __name__ == "__main__":
    main()
