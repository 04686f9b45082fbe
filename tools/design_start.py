"""Find a lens by the recipe of its search and write its prescription.

    python -m tools.design_start models_def/recipes/duet_lens.toml
    python -m tools.design_start models_def/recipes/lfov_start.toml
    python -m tools.design_start models_def/recipes/edof_start.toml

The built-in prescription of the recipe's name is written, or the file that `-o` names.
"""

import argparse
from pathlib import Path

import torch

from camkit.models_def.optics.prescription import write_prescription
from tools.start.recipe import read_recipe
from tools.start.search import design

PRESCRIPTIONS = Path(__file__).resolve().parents[1] / "models_def" / "prescriptions"


def main() -> None:
    """Find the lens and write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recipe", type=Path)
    parser.add_argument("-o", "--output", type=Path)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    recipe = read_recipe(arguments.recipe)
    result = design(recipe)
    path = arguments.output or PRESCRIPTIONS / f"{recipe.name}.toml"
    write_prescription(result.lens, path)
    print(f"merit {result.merit:.4f} mm, written to {path}")


if __name__ == "__main__":
    main()
