"""Merged light against the truth and against a slow reference, frame order, hostile brackets."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.errors import ContractError, DecodeError
from camkit.noise import NoiseModel
from camkit.runtime.merging.merge import choose_response, merge
from camkit.runtime.merging.response import srgb_response
from camkit.runtime.merging.survey import Survey, read_frame, survey
from camkit.runtime.signal.noise import fallback_noise
from tests.runtime.merging.bracket_factory import NOISE, TIMES_S, scene, write_coded, write_dng
from tests.runtime.merging.test_response_estimate import film_curve


def _raw_bracket(folder: Path, light: FloatArray) -> list[Path]:
    paths = [folder / f"{n}.dng" for n in range(len(TIMES_S))]
    for seed, (path, time_s) in enumerate(zip(paths, TIMES_S, strict=True)):
        write_dng(path, light, time_s, seed=seed)
    return paths


def _coded_bracket(folder: Path, times_s: tuple[float, ...], curve: object = None) -> list[Path]:
    paths = [folder / f"{n}.png" for n in range(len(times_s))]
    for seed, (path, time_s) in enumerate(zip(paths, times_s, strict=True)):
        write_coded(path, scene(96, 128) * time_s, curve, seed=seed)  # type: ignore[arg-type]
    return paths


def _slowly(found: Survey) -> FloatArray:
    """Average one sample after the other, as the formula says."""
    frames = [(f.time_s, read_frame(f.path, None)) for f in found.frames]
    height, width = frames[0][1].height, frames[0][1].width
    made = np.zeros((height, width))
    lit = [(t, c.linear_rows(0, height), c.saturated_rows(0, height)) for t, c in frames]
    step = 1 / (4095 - 256)
    for y in range(height):
        for x in range(width):
            mean, total = 0.0, 0.0
            for time_s, light, clipped in lit:
                if clipped[y, x]:
                    mean = mean if total else light[y, x] / time_s
                    continue
                expected = mean * time_s if total else float(light[y, x])
                variance = NOISE.shot[0] * max(expected, 0) + NOISE.read_variance[0] + step**2 / 12
                weight = time_s**2 / variance
                mean = (mean * total + weight * light[y, x] / time_s) / (total + weight)
                total += weight
            made[y, x] = mean
    return made.astype(np.float32)


def test_raw_frames_merge_as_the_formula_says_within_their_noise(tmp_path: Path) -> None:
    light = scene()[1]
    found = survey(_raw_bracket(tmp_path, light), None)
    merged = merge(found, None)
    np.testing.assert_allclose(merged.light[0], _slowly(found), rtol=2e-4, atol=1e-6)
    inside = light * TIMES_S[-1] < 0.95
    z = (merged.light[0] - light)[inside] * np.sqrt(merged.precision[0][inside])
    assert abs(z.mean()) < 0.1
    assert z.std() == pytest.approx(1, abs=0.1)
    assert merged.clipped_fraction == 0


def test_merging_beats_every_single_frame(tmp_path: Path) -> None:
    light = scene()[1]
    paths = _raw_bracket(tmp_path, light)
    merged = merge(survey(paths, None), None).light[0]
    error = np.abs(np.log2(np.maximum(merged, 1e-6) / light))
    for path, time_s in zip(paths, TIMES_S, strict=True):
        single = read_frame(path, None).linear_rows(0, 48) / time_s
        assert np.mean(error) < 0.8 * np.mean(np.abs(np.log2(np.maximum(single, 1e-6) / light)))


def test_a_pixel_clipped_everywhere_takes_the_shortest_and_is_counted(tmp_path: Path) -> None:
    light = np.full((32, 32), 0.2, dtype=np.float32)
    light[4, 5] = light[9, 3] = 500.0
    found = survey(_raw_bracket(tmp_path, light), None)
    merged = merge(found, None)
    assert merged.clipped_fraction == 2 / 1024
    assert merged.light[0, 4, 5] == pytest.approx(64, rel=0.011)
    assert merged.precision[0, 4, 5] == 0


def test_noise_that_files_do_not_state_is_measured(tmp_path: Path) -> None:
    light = scene(96, 128)[1]
    paths = [tmp_path / "a.dng", tmp_path / "b.dng"]
    for path, time_s in zip(paths, (0.02, 0.01), strict=True):
        write_dng(path, light, time_s, noise=None)
    merged = merge(survey(paths, None), None)
    stated = np.sqrt(merged.precision[0] / (2e-2**2 / (1e-4 * light * 0.02 + 1e-6)) * 0.02**2)
    assert 0.4 < np.median(stated) < 3


def test_noise_of_other_channels_than_the_planes_have_is_not_taken(tmp_path: Path) -> None:
    found = survey(_coded_bracket(tmp_path, (1.0, 0.25)), (1.0, 0.25))
    one = NoiseModel(shot=(0.5,), read_variance=(0.5,))
    stated = replace(found, frames=tuple(replace(f, noise=one) for f in found.frames))
    usual = replace(found, frames=tuple(replace(f, noise=fallback_noise()) for f in found.frames))
    assert (merge(stated, None).precision == merge(usual, None).precision).all()


def test_the_order_of_the_files_changes_no_bit(tmp_path: Path) -> None:
    paths = _coded_bracket(tmp_path, (1.0, 0.25, 0.25, 0.0625))
    made = []
    for order in ((0, 1, 2, 3), (3, 1, 0, 2), (2, 3, 1, 0)):
        times_s = [(1.0, 0.25, 0.25, 0.0625)[n] for n in order]
        found = survey([paths[n] for n in order], times_s)
        made.append(merge(found, choose_response(found, None)[0]).light.tobytes())
    assert made[0] == made[1] == made[2]


def test_pictures_behind_an_unknown_curve_merge_better_estimated(tmp_path: Path) -> None:
    times_s = (1.0, 0.5, 0.25, 0.125, 0.0625)
    found = survey(_coded_bracket(tmp_path, times_s, film_curve()), times_s)
    errors = {}
    for name in (None, "srgb"):
        response, _ = choose_response(found, name)  # type: ignore[arg-type]
        merged = merge(found, response)
        wrong = np.log2(merged.light / scene(96, 128))[merged.precision > 0]
        errors[merged.response] = float(np.sqrt(np.mean(wrong**2)))
    assert errors["estimate"] < 0.3 * errors["srgb"]


def test_pictures_in_srgb_merge_to_their_light(tmp_path: Path) -> None:
    found = survey(_coded_bracket(tmp_path, (1.0, 0.25, 0.0625)), (1.0, 0.25, 0.0625))
    merged = merge(found, choose_response(found, "srgb")[0])
    light = scene(96, 128)
    inside = (light < 12) & (light > 0.05)
    wrong = np.log2(merged.light / light)[inside]
    assert np.sqrt(np.mean(wrong**2)) < 0.03
    assert choose_response(found, "linear") == (None, "")


def test_where_nothing_speaks_srgb_is_taken_with_a_word(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_coded(tmp_path / f"{name}.png", np.full((3, 40, 40), 2.0, dtype=np.float32))
    found = survey([tmp_path / "a.png", tmp_path / "b.png"], (1.0, 0.5))
    response, note = choose_response(found, None)
    assert response is not None
    assert response.name == "srgb"
    assert "too few pixels are unclipped" in note
    with pytest.raises(DecodeError, match="use response"):
        choose_response(found, "estimate")


def test_srgb_stays_where_an_estimate_explains_no_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = survey(_coded_bracket(tmp_path, (1.0, 0.25)), (1.0, 0.25))
    same = replace(srgb_response(256), name="estimate")
    monkeypatch.setattr("camkit.runtime.merging.merge.estimate_response", lambda *_: same)
    monkeypatch.setattr("camkit.runtime.merging.merge.known_curve", lambda *_: None)
    response, note = choose_response(found, None)
    assert response is not None
    assert response.name == "srgb"
    assert "sRGB is used" in note


@pytest.mark.parametrize("wanted", ["srgb", "estimate"])
def test_raw_frames_have_no_curve(tmp_path: Path, wanted: str) -> None:
    found = survey(_raw_bracket(tmp_path, scene()[1]), None)
    with pytest.raises(ContractError, match="are linear"):
        choose_response(found, wanted)  # type: ignore[arg-type]


def test_a_frame_that_changes_in_between_is_refused(tmp_path: Path) -> None:
    paths = _raw_bracket(tmp_path, scene()[1])
    found = survey(paths, None)
    write_dng(paths[1], scene()[0], TIMES_S[1])
    with pytest.raises(DecodeError, match=r"1\.dng changed while"):
        merge(found, None)
