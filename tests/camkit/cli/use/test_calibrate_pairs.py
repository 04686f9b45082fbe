"""`camkit calibrate targets` and `pairs`: what is shown, photographed, and laid over each other."""

import json
import shutil
import tomllib

import cv2
import numpy as np
import pytest

from camkit.calibration.display.alignment import map_places
from camkit.cli.exit_code import ExitCode
from camkit.colorimetry import encode_srgb
from camkit.scenes import procedural_scene
from tests.camkit.calibration.display.screen_factory import COLOURS, DARK, Booth

PLACED_PX = 0.1
COLOUR = 0.01
SCREEN = (720, 432)
BOOTH = Booth(screen=SCREEN, size=(480, 320), level=0.75)


def codes_of(path):
    return cv2.imread(str(path))[..., ::-1]


@pytest.fixture(scope="module", name="set_up")
def screen_and_captures(tmp_path_factory):
    """Targets of two pictures, captures of them and of the colours under names without meaning."""
    from camkit.cli.app import run

    home = tmp_path_factory.mktemp("screen")
    pictures = [home / "one.png", home / "two.png"]
    for number, path in enumerate(pictures):
        scene = np.clip(procedural_scene(number + 3, 240, 360), 0, 1)
        codes = np.rint(255 * encode_srgb(scene)).astype(np.uint8)
        cv2.imwrite(str(path), codes.transpose(1, 2, 0)[..., ::-1])
    asked = ["calibrate", "targets", *pictures, "-o", home / "targets", "--screen", "720x432"]
    assert run([str(one) for one in [*asked, "--levels", "0,255"]]) == 0
    shown = sorted((home / "targets").glob("*.png"))[3:]
    assert len(shown) == 9
    for number, path in enumerate(reversed(shown)):
        BOOTH.write(home / f"{number}.dng", codes_of(path), seed=number)
    BOOTH.write_geometry(home / "geometry.toml")
    BOOTH.write_tone(home / "tone.toml")
    return home


def asked(home, captures, *more, targets=None):
    return [
        *("calibrate", "pairs", *captures, "--targets", targets or home / "targets"),
        *("--geometry", home / "geometry.toml", "--tone", home / "tone.toml", *more),
    ]


def test_pairs_lie_on_captures_to_a_tenth_of_a_pixel_and_colours_to_one_percent(
    camkit_command, set_up, tmp_path
):
    out, page = tmp_path / "pairs", tmp_path / "pairs.html"
    captures = [set_up / f"{n}.dng" for n in range(9)]
    done = camkit_command(*asked(set_up, captures, "-o", out, "--page", page, "--json"))
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert [(one["name"], one["file"]) for one in told["pairs"]] == [
        ("one", "1.dng"),
        ("two", "0.dng"),
    ]
    targets = tomllib.loads((set_up / "targets" / "targets.toml").read_text())["targets"]
    for one, target in zip(told["pairs"], targets[-2:], strict=True):
        x, y, width, height = target["place_px"]
        at = np.stack(np.meshgrid([0, width / 2, width - 1], [0, height / 2, height - 1]), -1)
        at = at.reshape(-1, 2)
        gap = map_places(np.array(one["homography"]), at) - map_places(
            BOOTH.homography, at + np.array([x, y])
        )
        assert np.linalg.norm(gap, axis=1).max() < PLACED_PX
        assert one["residual_px"] < PLACED_PX
    # the whole lens sees the patch in its middle; only its brightness is the vignetting's
    found = np.array(told["display"]["matrix"])
    wanted = COLOURS * (1 - DARK)
    wanted *= (found * wanted).sum() / (wanted**2).sum()
    assert np.abs(found - wanted).max() < COLOUR * wanted.max()
    assert told["display"]["residual_percent"] < 1
    assert tomllib.loads((out / "pairs.toml").read_text()) == {
        "iso": 100.0,
        "white_balance": pytest.approx([2.0, 1.0, 1.6]),
    }
    assert page.read_text().count("<img") == 1
    _check_files(out, told)
    assert camkit_command(*asked(set_up, captures, "-o", out)).code == ExitCode.USAGE


def _check_files(out, told):
    assert sorted(path.name for path in (out / "capture").iterdir()) == ["one.tiff", "two.tiff"]
    for one in told["pairs"]:
        capture = cv2.imread(str(out / "capture" / f"{one['name']}.tiff"), cv2.IMREAD_UNCHANGED)
        assert (capture.dtype, capture.shape) == (np.uint16, (320, 480, 3))
        reference = codes_of(out / "reference" / f"{one['name']}.png")
        assert reference.shape[1::-1] == tuple(one["reference_px"][2:])


@pytest.mark.parametrize(
    ("captures", "told"),
    [
        ((0, 0, 1), "is given twice"),
        ((0,), "no capture shows 011-one.png"),
        ((0, 1, 2), "no capture shows 004-red.png"),
        ((0, 1, "copy"), "0.dng and copy.dng both show 012-two.png"),
        ((0, 1, "grey"), "grey.dng shows no marks"),
        ((0, 1, "large"), "large.dng has 240x160 px, the geometry is of 480x320"),
        ((0, 1, "none"), "none.dng"),
        ((0, "swapped"), "swapped.dng (011-one.png): capture and picture correlate by"),
    ],
)
def test_bad_captures_are_one_line_and_no_file(camkit_command, set_up, tmp_path, captures, told):
    special = {"copy": BOOTH, "grey": BOOTH, "large": Booth(screen=SCREEN, size=(240, 160))}
    name = captures[-1]
    if name == "copy":
        shutil.copy(set_up / "0.dng", tmp_path / "copy.dng")
    elif name in special:
        grey = np.full((SCREEN[1], SCREEN[0], 3), 128, np.uint8)
        special[name].write(tmp_path / f"{name}.dng", grey)
    elif name == "swapped":
        # the marks of one picture about another
        codes = codes_of(set_up / "targets" / "011-one.png").copy()
        codes[:, 100:620] = codes[:, 619:99:-1]
        BOOTH.write(tmp_path / "swapped.dng", codes)
    files = [set_up / f"{n}.dng" if isinstance(n, int) else tmp_path / f"{n}.dng" for n in captures]
    done = camkit_command(*asked(set_up, files, "-o", tmp_path / "pairs"))
    assert done.code == (ExitCode.USAGE if "twice" in told else ExitCode.INPUT_FAILED), done.err
    assert told in done.err
    assert len(done.err.strip().splitlines()) == 1
    assert not (tmp_path / "pairs").exists()


def test_captures_and_what_was_shown_may_be_two_folders(camkit_command, set_up, tmp_path):
    shots, out = tmp_path / "shots", tmp_path / "pairs"
    shots.mkdir()
    for number in (0, 1):
        shutil.copy(set_up / f"{number}.dng", shots)
    end = ("--geometry", set_up / "geometry.toml", "-o", out)
    done = camkit_command("calibrate", "pairs", shots, set_up / "targets", *end)
    assert done.code == 0, done.err
    assert "2 pairs" in done.out
    for named, told in (([shots / "0.dng"], "add --targets DIR"), ([shots], "no capture is")):
        done = camkit_command("calibrate", "pairs", *named, *end[:3], tmp_path / "none")
        assert done.code == ExitCode.USAGE
        assert told in done.err


def test_another_geometry_is_refused_by_what_it_leaves(camkit_command, set_up, tmp_path):
    text = (set_up / "geometry.toml").read_text().replace("-0.12", "0.05")
    (tmp_path / "geometry.toml").write_text(text)
    shutil.copy(set_up / "tone.toml", tmp_path)
    files = [set_up / f"{n}.dng" for n in (0, 1)]
    ask = asked(tmp_path, files, "-o", tmp_path / "pairs", targets=set_up / "targets")
    done = camkit_command(*ask)
    assert done.code == ExitCode.INPUT_FAILED
    assert "0.5 is allowed" in done.err
    assert not (tmp_path / "pairs").exists()
    (tmp_path / "geometry.toml").write_text("model = 3\n")
    assert "is not what `camkit calibrate geometry` writes" in camkit_command(*ask).err
