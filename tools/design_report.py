"""Judge lenses behind one camera: its bank and its network, on fresh Monte-Carlo samples.

    python -m tools.design_report models_def/recipes/duet_joint.toml --data PICTURES --seed 2701 \
        --lens duet-joint=duet-joint --lens runs/duet-joint-bank/duet-joint-bank.toml=...pt

All lenses take the same pictures at the same places with the same errors of fabrication. What the
bank knows of how copies scatter is measured for each lens on samples of its own; its other numbers
are those of the recipe, or with --fit those of every lens. Gains are over the first lens, paired;
their error is that of the mean over pictures.
"""

import argparse
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import torch

from camkit.bundle.stages import Together
from camkit.bundle.stages.network import DEFAULT_ROLE
from camkit.models_def.kinds.bayer.bank_fit import fit_bank, spread_of
from camkit.models_def.kinds.bayer.material import BayerMaterial, trace_material
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.kinds.bayer.training import PART
from camkit.models_def.kinds.bayer.validation import (
    FIELD_SHARES,
    ISOS,
    every_db,
    make_validation_captures,
)
from camkit.models_def.training.bank_fitting import BankFitOptions
from camkit.models_def.training.first_weights import read_first_weights, take_first_weights
from camkit.models_def.training.kind import Restorer, build_role, read_recipe
from tools.comparison.paired import mean_and_error
from tools.tables.records import markdown_table

COPIES: Final = 8
Label = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """PSNR of every capture: `name` says the lens and the method, `place` is (field, ISO)."""

    name: str
    every_db: list[float]
    places: list[Label]


def bank_restorer(planes: torch.Tensor) -> torch.Tensor:
    """Return what the bank made."""
    return planes[:, 3:6]


def network_restorer(recipe: BayerRecipe, size: str, weights: str) -> Restorer:
    """Return the network of a size with the weights of a bundle or checkpoint."""
    network, _ = build_role(PART, recipe, DEFAULT_ROLE, size)
    take_first_weights(network, read_first_weights(Path(weights), size))
    return network.eval()


def fitted(
    recipe: BayerRecipe, material: BayerMaterial, pictures: Path | None, *, fits: bool
) -> Together:
    """Return the numbers of the bank for a lens: V measured, the others kept or fitted."""
    if fits:
        options = BankFitOptions(pictures=pictures, recipe_folder=Path(), cache_folder=Path())
        return fit_bank(recipe, material, options, print).together
    together = recipe.wiener.together
    if together is None:
        raise SystemExit("the bank of the recipe does not restore colours together")
    return together.model_copy(update={"spread": spread_of(material.bank, recipe)})


def judged(
    recipe: BayerRecipe, name: str, weights: list[str], arguments: argparse.Namespace
) -> list[Row]:
    """Return a row of the bank, and one of the network for each source of weights."""
    lens = replace(
        recipe.lens, prescription=name, seed=arguments.seed, copies=COPIES, validation_copies=COPIES
    )
    camera = replace(recipe, lens=lens)
    material = trace_material(camera, arguments.recipe.parent, arguments.cache)
    camera = camera.with_together(fitted(camera, material, arguments.fit_data, fits=arguments.fit))
    captures = make_validation_captures(camera, material.bank, arguments.data)
    places = [(c.field_share, c.iso) for c in captures]
    title = Path(name).stem
    ways: list[tuple[str, Restorer]] = [(f"{title}, bank", bank_restorer)]
    for source in weights:
        restorer = network_restorer(camera, arguments.size, source)
        ways.append((f"{title}, {arguments.size} of {Path(source).stem}", restorer))
    return [
        Row(name=way, every_db=every_db(captures, camera, restore), places=places)
        for way, restore in ways
    ]


def table_of(rows: list[Row], base: Row) -> str:
    """Return a table of means, and of gains over the row `base`."""
    heads = ["", "dB", f"over {base.name}", *(f"ISO {iso:g}" for iso in ISOS)]
    heads += [f"field {share:g}" for share in FIELD_SHARES]
    cells = []
    for row in rows:
        gaps = [a - b for a, b in zip(row.every_db, base.every_db, strict=True)]
        pictures = [i // (len(ISOS) * len(FIELD_SHARES)) for i in range(len(gaps))]
        gain, error = mean_and_error(gaps, pictures)
        by_iso = [_mean(gaps, [p[1] == iso for p in row.places]) for iso in ISOS]
        by_field = [_mean(gaps, [p[0] == share for p in row.places]) for share in FIELD_SHARES]
        level = sum(row.every_db) / len(row.every_db)
        spread = "" if error is None else f" +- {error:.2f}"
        parts = [f"{value:+.2f}" for value in (*by_iso, *by_field)]
        cells.append([row.name, f"{level:.2f}", f"{gain:+.2f}{spread}", *parts])
    return markdown_table(heads, cells)


def _mean(values: list[float], are_chosen: list[bool]) -> float:
    values_there = [value for value, is_chosen in zip(values, are_chosen, strict=True) if is_chosen]
    return sum(values_there) / len(values_there)


def main() -> None:
    """Judge the lenses and print a table for the bank and one for the network."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recipe", type=Path)
    parser.add_argument("--lens", action="append", required=True, help="LENS[=WEIGHTS[,WEIGHTS]]")
    parser.add_argument("--data", type=Path, help="pictures to judge on; default: procedural")
    parser.add_argument("--size", default="S")
    parser.add_argument("--seed", type=int, default=2701, help="of the copies")
    parser.add_argument("--fit", action="store_true", help="fit the bank to every lens")
    parser.add_argument("--fit-data", type=Path, help="pictures to fit it on")
    parser.add_argument("--cache", type=Path, default=Path("runs/cache"))
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    recipe = read_recipe(arguments.recipe)
    if not isinstance(recipe, BayerRecipe):
        raise SystemExit("a camera behind a mosaic is judged")
    banks: list[Row] = []
    networks: list[Row] = []
    for choice in arguments.lens:
        name, _, sources = choice.partition("=")
        bank, *others = judged(recipe, name, [s for s in sources.split(",") if s], arguments)
        banks.append(bank)
        networks += others
    print(table_of(banks, banks[0]))
    if networks:
        print(f"\n{table_of(networks, networks[0])}")


if __name__ == "__main__":
    main()
