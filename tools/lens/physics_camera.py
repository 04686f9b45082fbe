"""The camera of a recipe without its networks: what the filter alone makes of some optics.

    python -m tools.lens.physics_camera thin_plate.toml psf.safetensors haze.safetensors -o FILE

The recipe says sensor, stages and the numbers of the bank; optics are those of `camkit freeze`.
"""

import argparse
from pathlib import Path

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.haze_file import read_haze
from camkit.bundle.psf_file import read_psf
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.frames.photographs import physics_bundle
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.training.kind import read_recipe
from tools.hdr.record import in_one_line


@in_one_line
def main() -> None:
    """Read, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("recipe", type=Path)
    parser.add_argument("psf", type=Path)
    parser.add_argument("haze", type=Path, nargs="?", help="where the recipe undoes one")
    parser.add_argument("-o", "--output", type=Path, required=True, help=".camkit, replaced")
    chosen = parser.parse_args()
    recipe = read_recipe(chosen.recipe)
    if not isinstance(recipe, BayerRecipe):
        raise ContractError(f"{chosen.recipe} is of another kind of camera")
    if (recipe.haze is None) != (chosen.haze is None):
        needs = "undoes no haze, give none" if recipe.haze is None else "undoes a haze, give one"
        raise ContractError(f"{chosen.recipe} {needs}")
    haze = None if chosen.haze is None else read_haze(chosen.haze)
    bundle = physics_bundle(
        recipe, FrozenOptics(psf=read_psf(chosen.psf), haze=haze), chosen.output
    )
    print(f"{chosen.output}: {bundle.manifest.name}, no network")


if __name__ == "__main__":
    main()
