r"""How well a merged bracket predicts a frame that it never saw, beside OpenCV's Debevec.

    python -m tools.hdr.leave_one_out BRACKET... -o docs/results/merging.json

BRACKET is a folder of 8-bit pictures with `image_list.txt` (lines NAME SECONDS). Every frame but
the longest and the shortest is left out once; response and light come from the others alone, and
the light is put through the response at the time of the frame. The residual is in codes, root mean
square over samples of code 1 to 254 of the frame left out, the same for all ways. Borders of pure
blue, which mark where registered frames end, are cut off first.
"""

import argparse
import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.runtime.merging.merge import choose_response, merge
from camkit.runtime.merging.response import ResponseName
from camkit.runtime.merging.survey import survey
from camkit.runtime.merging.times import stated_times

LIST: Final = "image_list.txt"
LEAST_FRAMES: Final = 3
BLUE: Final = (255, 0, 0)  # as OpenCV orders them

Pictures = list[NDArray[np.uint8]]
Times = NDArray[np.float64]
Predict = Callable[[Pictures, Times, float], NDArray[np.float64]]


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("brackets", nargs="+", type=Path, metavar="BRACKET")
    parser.add_argument("-o", "--output", type=Path)
    arguments = parser.parse_args()
    found = {folder.name: compare(folder) for folder in arguments.brackets}
    ways = list(WAYS)
    print(f"| codes rms, mean (worst frame) | {' | '.join(ways)} |")
    print("|---" * (len(ways) + 1) + "|")
    for name, record in found.items():
        cells = [f"{np.mean(record[way]):.2f} ({max(record[way]):.2f})" for way in ways]
        print(f"| {name} | {' | '.join(cells)} |")
    if arguments.output is not None:
        arguments.output.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


def compare(folder: Path) -> dict[str, Any]:
    """Return for each way the residual of each inner frame, and their times."""
    pictures, times_s = read_bracket(folder)
    record: dict[str, Any] = {"left_out_s": times_s[1:-1].tolist()}
    for way, predict in WAYS.items():
        record[way] = []
        for left_out in range(1, len(pictures) - 1):
            others = [n for n in range(len(pictures)) if n != left_out]
            codes = predict([pictures[n] for n in others], times_s[others], times_s[left_out])
            record[way].append(round(residual(codes, pictures[left_out]), 3))
    return record


def read_bracket(folder: Path) -> tuple[Pictures, Times]:
    """Return pictures (h, w, 3) as OpenCV orders them and their times, longest first."""
    names = [line.split()[0] for line in (folder / LIST).read_text().splitlines() if line.strip()]
    files = [folder / name for name in names if not name.startswith("#")]
    times_s = np.array(stated_times(str(folder / LIST), files))
    if len(files) < LEAST_FRAMES:
        raise SystemExit(f"{folder}: {len(files)} frames; to leave one out takes {LEAST_FRAMES}")
    order = np.argsort(-times_s)
    pictures = [np.asarray(cv2.imread(str(files[n])), dtype=np.uint8) for n in order]
    return without_borders(pictures), times_s[order]


def without_borders(pictures: Pictures) -> Pictures:
    """Cut rows and columns off at the border that holds most blue, until none is left."""
    blue = np.any([(picture == BLUE).all(axis=2) for picture in pictures], axis=0)
    top, left = 0, 0
    bottom, right = blue.shape
    while blue[top:bottom, left:right].any():
        inside = blue[top:bottom, left:right]
        shares = [inside[0].mean(), inside[-1].mean(), inside[:, 0].mean(), inside[:, -1].mean()]
        worst = int(np.argmax(shares))
        top, bottom = top + (worst == 0), bottom - (worst == 1)
        left, right = left + (worst == 2), right - (worst == 3)
    return [np.ascontiguousarray(picture[top:bottom, left:right]) for picture in pictures]


def residual(codes: NDArray[np.float64], picture: NDArray[np.uint8]) -> float:
    """Return the root mean square over samples that are neither black nor white."""
    open_ = (picture > 0) & (picture < 255)
    return float(np.sqrt(np.mean((codes - picture)[open_] ** 2)))


def by_opencv(pictures: Pictures, times_s: Times, time_s: float) -> NDArray[np.float64]:
    """Predict a frame by `createCalibrateDebevec` and `createMergeDebevec`, as they come."""
    times = times_s.astype(np.float32)
    curves = cv2.createCalibrateDebevec().process(pictures, times)
    light = np.asarray(cv2.createMergeDebevec().process(pictures, times, curves))
    rising = np.maximum.accumulate(curves[:, 0].astype(np.float64), axis=0)
    return _through(light.astype(np.float64) * time_s, rising.T)


def by_camkit(response: ResponseName) -> Predict:
    """Return what predicts a frame by camkit with a response."""

    def predict(pictures: Pictures, times_s: Times, time_s: float) -> NDArray[np.float64]:
        with tempfile.TemporaryDirectory() as folder:
            files = [Path(folder, f"{n:03d}.png") for n in range(len(pictures))]
            for file, picture in zip(files, pictures, strict=True):
                cv2.imwrite(str(file), picture)
            bracket = survey(files, times_s.tolist())
            curve, _ = choose_response(bracket, response)
            if curve is None:
                raise SystemExit(f"{response} is no curve")
            merged = merge(bracket, curve)
        light = merged.light.astype(np.float64) * (time_s / merged.times_s[0])
        return _through(light[::-1].transpose(1, 2, 0), np.exp(curve.log_light[::-1]))

    return predict


WAYS: Final[dict[str, Predict]] = {
    "opencv": by_opencv,
    "srgb": by_camkit("srgb"),
    "estimate": by_camkit("estimate"),
}


def _through(light: NDArray[np.float64], curves: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
    """Return the codes of (h, w, 3) light by (3, 256) rising light of codes."""
    codes = np.arange(curves.shape[1])
    return np.stack([np.interp(light[..., c], curves[c], codes) for c in range(3)], axis=-1)


if __name__ == "__main__":
    main()
