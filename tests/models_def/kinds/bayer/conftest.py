"""The fixtures of small cameras, behind a mosaic and of planes."""

from tests.bayer_recipe import (  # noqa: F401
    bank,
    material,
    planes_recipe,
    planes_recipe_path,
    recipe,
    recipe_path,
)
