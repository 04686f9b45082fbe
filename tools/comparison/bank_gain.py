"""What a bank that restores colours together is worth by itself, through several copies of a lens.

    python -m tools.comparison.bank_gain RECIPE --data TESTS/set14 -o docs/results/bank.json

RECIPE holds `[wiener.together]` (`camkit fit-bank`). Captures as of `tools.quality` through freshly
traced copies, picture i through copy i: the bundle's bank as it is, the same with the recipe's
model, and ADMM-TV with the parameters that `docs/results/quality.json` holds. PSNR on sRGB values;
gains are paired, with their standard error over captures, and told by ISO, copy and place too.
"""

import argparse
import json
import statistics
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.bundle.stages import Together, Wiener
from camkit.errors import ContractError
from camkit.report.bench.machine import describe_machine
from camkit.report.fabricated_optics import fabricated_optics
from camkit.report.quality import (
    FIELD_SHARES,
    Shot,
    inner_srgb,
    list_set,
    psnr,
    read_picture,
)
from tools.comparison.compact_json import to_compact_json
from tools.comparison.paired import mean_and_error
from tools.comparison.peers import PEERS
from tools.comparison.photograph import (
    Photograph,
    Restorer,
    bundle_restorer,
    finish_planes,
    photograph,
)
from tools.comparison.tuning import tuned_from_json

ISOS: Final = (100.0, 1600.0)
TUNED: Final = Path("docs/results/quality.json")
PEER: Final = "admm_tv"
ALONE, TOGETHER = "alone", "together"
DIGITS: Final = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """One capture.

    Attributes:
        copy: Seed of the lens.
        position: Index into `FIELD_SHARES`.
        iso: Sensitivity.
        psnr_db: Way -> dB.
    """

    copy: int
    position: int
    iso: float
    psnr_db: Mapping[str, float]


def main(words: Sequence[str] | None = None) -> None:
    """Measure and write JSON."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("recipe", type=Path, help="with [wiener.together]")
    parser.add_argument("--bundle", default="duet", help="NAME or PATH")
    parser.add_argument("--data", type=Path, required=True, help="folder of sharp pictures")
    parser.add_argument("--pictures", type=int, help="the first of them by name")
    parser.add_argument("--places", type=int, default=len(FIELD_SHARES), help="of the field")
    parser.add_argument("--work-dir", type=Path, default=Path("runs/quality"), help="traced PSFs")
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args(words)
    bundle = open_bundle(find_bundle(arguments.bundle))
    ways = restorers(bundle, together_of(arguments.recipe))

    @lru_cache
    def lens(copy: int) -> FrozenOptics:
        return fabricated_optics(bundle, copy, cache_folder=arguments.work_dir / "psf")

    found = []
    for number, picture in enumerate(list_set(arguments.data, arguments.pictures)):
        for position in range(0, len(FIELD_SHARES), -(-len(FIELD_SHARES) // arguments.places)):
            for iso in ISOS:
                shot = Shot(
                    set_name=arguments.data.name,
                    picture=picture,
                    number=number,
                    position=position,
                    iso=iso,
                    psf="fresh",
                )
                copy = shot.fabrication_seed
                taken = photograph(shot, read_picture(picture), bundle, lens(copy))
                judged = {name: _psnr_db(restore, taken) for name, restore in ways.items()}
                found.append(Judged(copy=copy, position=position, iso=iso, psnr_db=judged))
        print(json.dumps(gains(found)), flush=True)
    record = {
        "machine": describe_machine(),
        "bundle": bundle.manifest.name,
        "captures": len(found),
        "psnr_db": {name: statistics.fmean(one.psnr_db[name] for one in found) for name in ways},
        "gain_db": gains(found),
        "by_iso": _parts(found, lambda one: f"{one.iso:g}"),
        "by_copy": _parts(found, lambda one: str(one.copy)),
        "by_place": _parts(found, lambda one: f"{FIELD_SHARES[one.position]:g}"),
    }
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    arguments.output.write_text(to_compact_json(record, DIGITS) + "\n", encoding="utf-8")


def together_of(recipe: Path) -> Together:
    """Return the model that a recipe states.

    Raises:
        ContractError: If it states none.
    """
    table = tomllib.loads(recipe.read_text(encoding="utf-8")).get("wiener", {})
    if "together" not in table:
        raise ContractError(f"{recipe.name} has no table [wiener.together]; see camkit fit-bank")
    return Together.model_validate(table["together"])


def restoring_together(bundle: Bundle, together: Together) -> Bundle:
    """Return a bundle whose bank restores colours together; its hash stays."""
    stages = tuple(
        stage.model_copy(update={"together": together}) if isinstance(stage, Wiener) else stage
        for stage in bundle.manifest.stages
    )
    return replace(bundle, manifest=bundle.manifest.model_copy(update={"stages": stages}))


def restorers(bundle: Bundle, together: Together) -> dict[str, Restorer]:
    """Return every way."""
    other = restoring_together(bundle, together)
    tuned = tuned_from_json(json.loads(TUNED.read_text(encoding="utf-8"))["tuned"]["values"])

    def peer(taken: Photograph) -> Any:
        setting = tuned[PEER][taken.simulation.iso]
        return finish_planes(PEERS[PEER].restore(taken.local, setting), taken, bundle)

    return {
        ALONE: bundle_restorer(bundle, method="wiener"),
        TOGETHER: bundle_restorer(other, method="wiener"),
        PEER: peer,
    }


def _psnr_db(restore: Restorer, taken: Photograph) -> float:
    return psnr(*inner_srgb(restore(taken), taken.sharp))


def gains(found: Sequence[Judged]) -> dict[str, dict[str, float | None]]:
    """Return what `together` gains over the others, with its standard error over copies."""
    told = {}
    for other in (ALONE, PEER):
        each = [one.psnr_db[TOGETHER] - one.psnr_db[other] for one in found]
        mean_db, error_db = mean_and_error(each, [one.copy for one in found])
        told[other] = {"mean": mean_db, "se": error_db}
    return told


def _parts(found: Sequence[Judged], key: Callable[[Judged], str]) -> dict[str, Any]:
    return {
        part: gains([one for one in found if key(one) == part])
        for part in sorted({key(one) for one in found})
    }


if __name__ == "__main__":
    main()
