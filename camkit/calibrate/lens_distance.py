"""Pictures of planes and a lens file to what no file states: distance origin, defocus, tone curve.

wide picture, sharp picture -> blurs that know no lens, fitted         pair_scene
lens focused and placed from every origin, sensor moved -> its blurs   placed_pair
  -> whose prediction of the wide picture is best
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from camkit.calibrate.pair_scene import PairScene, PlainBlur, read_scene_pair
from camkit.calibrate.pair_words import PairWords
from camkit.calibrate.result_files import check_result, paths_of, write_results
from camkit.calibration.blur_pair.blur_errors import BlurErrors
from camkit.calibration.blur_pair.blur_search import SearchResult, search
from camkit.calibration.blur_pair.distance_facts import BlurRow, DistanceFacts, Plane
from camkit.calibration.blur_pair.plain_blurs import disc_transfer, gaussian_transfer
from camkit.calibration.record import to_toml
from camkit.caller import command_text, option_text
from camkit.errors import ContractError
from camkit.field_types import checked
from camkit.models_def.face.torch_need import require_torch
from camkit.progress import working
from camkit.runtime.files.in_memory import FilePath
from camkit.runtime.signal.halves import Halves, check_halves, without_right_halves
from camkit.runtime.signal.tone_curve import Tone, read_tone

if TYPE_CHECKING:
    from camkit.calibrate.placed_pair import PlacedPair

SIGMA_OF_DISC: Final = 0.26
"""Of a diameter, about: the Gaussian that is as wide as a disc."""


@checked
@working("comparing blurs")
def distance(
    pictures: FilePath | Sequence[FilePath],
    lens: FilePath,
    out: FilePath | None = None,
    *,
    words: PairWords,
    tones: Sequence[FilePath] = (),
    halves: Halves | None = None,
    overwrite: bool = False,
) -> DistanceFacts:
    """Fit what distances count from, the defocus and the tone curve on pairs of pictures of planes.

    One plane shows the defocus if the origin is known; two planes, at one focus, show both. The
    sharp picture is blurred as the traced lens would, and compared with the wide one. Gains, sizes
    and shifts are fitted on half of the blocks of the picture and judged on the other half.

    Args:
        pictures: The wide picture and the sharp one of a plane, developed, then those of the next
            plane; of dual pixels the left halves.
        lens: Lens file (.toml, .zmx), or the name of a built-in lens (needs torch).
        out: Result to write (.toml); None writes none.
        words: The use of the lens.
        tones: Tone curves to choose from: srgb, linear or files of `tone`; none for what the
            pictures state.
        halves: Texts by which the names of dual-pixel halves differ, such as ("_l", "_r").
        overwrite: Whether a file that exists is replaced.

    Raises:
        ContractError: If a word is wrong, or the lens cannot be focused so.
        DecodeError: If a picture cannot be read, or both do not belong together.
        UnsupportedError: If torch is not installed, or the lens holds what camkit does not trace.
    """
    out_file = check_result(out, ".toml", overwrite=overwrite)
    require_torch(command_text("calibrate distance"))
    check_halves(halves)
    files = without_right_halves(paths_of(pictures), halves)
    curves: list[Tone | None] = [read_tone(str(tone)) for tone in tones]
    planes = [
        _PlaneScene(
            object_m=object_m,
            scene=read_scene_pair(files[2 * i : 2 * i + 2], curves or [None], halves, words),
        )
        for i, object_m in enumerate(_planes_m(files, words))
    ]
    facts = _facts(planes, Path(lens), words)
    write_results((out_file, None), lambda: to_toml(facts.to_record()).encode(), str)
    return facts


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _PlaneScene:
    """A pair of pictures and where their plane was."""

    object_m: float
    scene: PairScene


def _planes_m(files: Sequence[Path], words: PairWords) -> tuple[float, ...]:
    """Return the distance of the plane of every pair.

    Raises:
        ContractError: If there is not one for each.
    """
    planes_m = words.planes_m
    if len(files) != 2 * len(planes_m) or not planes_m:
        raise ContractError(
            f"expected {2 * len(planes_m)} pictures, a wide one and a sharp one for each distance "
            f"of {option_text('object_m')}; got {len(files)}: "
            f"{', '.join(file.name for file in files)}"
        )
    return planes_m


def _facts(planes: Sequence[_PlaneScene], lens: Path, words: PairWords) -> DistanceFacts:
    """Compare every blur with the wide pictures by every curve, and choose.

    Raises:
        ContractError: If the lens cannot be focused so, or no origin suits every plane.
    """
    from camkit.calibrate.placed_pair import place_pair

    lenses = [place_pair(lens, words, plane.object_m, plane.scene) for plane in planes]
    scenes = [plane.scene for plane in planes]
    is_even = np.concatenate([scene.is_even for scene in scenes])
    tones = tuple(scenes[0].judges)
    by_tone: dict[str, dict[str, SearchResult]] = {tone: {} for tone in tones}
    origins = [o for o in lenses[0].rays if all(o in one.rays for one in lenses)]
    if not origins:
        raise ContractError("no origin of distances places every plane before the lens")
    for origin in origins:
        errors_at = _errors_at(scenes, lenses, origin)
        for tone, fits in by_tone.items():
            fits[origin] = search(partial(errors_at, tone), 0.0, lenses[0].step_mm, is_even)
    tones_db = {
        tone: max(fit.errors.psnr_db() for fit in fits.values()) for tone, fits in by_tone.items()
    }
    best = max(tones_db, key=lambda tone: tones_db[tone])
    return DistanceFacts(
        fits=by_tone[best],
        tone=best,
        tones_db=tones_db,
        rows=(*plain_rows(scenes, best), *_lens_rows(by_tone[best])),
        planes=tuple(
            Plane(
                object_m=plane.object_m,
                registration=plane.scene.registration,
                disc_px=plane.scene.disc_px,
                share=plane.scene.share,
            )
            for plane in planes
        ),
        tolerance_mm=2 * lenses[0].step_mm,
        notes=tuple(dict.fromkeys(note for one in lenses for note in one.notes)),
    )


def _errors_at(
    scenes: Sequence[PairScene], lenses: Sequence["PlacedPair"], origin: str
) -> Callable[[str, float], BlurErrors]:
    """Return the errors of the lens by tone curve and defocus, each defocus blurred once."""

    @cache
    def errors(defocus_mm: float) -> dict[str, BlurErrors]:
        parts = [
            scene.errors(one.transfers(origin, defocus_mm))
            for scene, one in zip(scenes, lenses, strict=True)
        ]
        return {tone: BlurErrors.joined([part[tone] for part in parts]) for tone in parts[0]}

    return lambda tone, defocus_mm: errors(defocus_mm)[tone]


def plain_rows(scenes: Sequence[PairScene], tone: str) -> list[BlurRow]:
    """Return blurs that know no lens, their sizes fitted to every pair by a curve."""
    one = np.ones((1, 1, 1))
    none = BlurErrors.joined([scene.errors([one])[tone] for scene in scenes])
    rows = [BlurRow(name="none", setting="", errors=none)]
    blurs: tuple[tuple[str, PlainBlur, float, str], ...] = (
        ("Gaussian", gaussian_transfer, SIGMA_OF_DISC, "sigma"),
        ("disc", disc_transfer, 1.0, "diameter"),
    )
    for name, blur, of_disc, what in blurs:
        fits = [scene.plain(blur, tone, of_disc * scene.disc_px) for scene in scenes]
        sizes = ", ".join(f"{np.exp(fit.best):.2f}" for fit in fits)
        errors = BlurErrors.joined([fit.errors for fit in fits])
        rows.append(BlurRow(name=name, setting=f"{what} {sizes} px", errors=errors))
    return rows


def _lens_rows(fits: dict[str, SearchResult]) -> list[BlurRow]:
    """Return the lens from every origin, in best focus and with the sensor moved."""
    rows = [
        BlurRow(name=f"lens, from {origin}", setting="in best focus", errors=fit.start)
        for origin, fit in fits.items()
    ]
    for origin, fit in fits.items():
        setting = f"sensor moved by {fit.best:+.3f} mm"
        rows.append(BlurRow(name=f"lens, from {origin}", setting=setting, errors=fit.errors))
    return rows
