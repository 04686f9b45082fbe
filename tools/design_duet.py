"""Find the lens of `duet` again and write its prescription: python -m tools.design_duet."""

from pathlib import Path

from camkit.models_def.optics.prescription import write_prescription
from camkit.models_def.optics.search.design import design
from camkit.models_def.optics.search.recipe import read_recipe

MODELS = Path(__file__).resolve().parents[1] / "models_def"


def main() -> None:
    recipe = read_recipe(MODELS / "recipes" / "duet_lens.toml")
    result = design(recipe)
    path = MODELS / "prescriptions" / "duet.toml"
    write_prescription(result.lens, path)
    print(f"merit {result.merit:.4f} mm, written to {path}")


if __name__ == "__main__":
    main()
