from tests.bayer_recipe import bank, material, one_picture_to_validate_on, recipe, recipe_path
from tests.lab_package.install import lab_installed

__all__ = [
    "bank",
    "lab_installed",
    "material",
    "one_picture_to_validate_on",
    "recipe",
    "recipe_path",
]
