"""The fixtures of a small camera behind a mosaic."""

from tests.bayer_recipe import (  # noqa: F401
    bank,
    material,
    one_picture_to_validate_on,
    recipe,
    recipe_path,
)
from tests.one_thread import one_thread  # noqa: F401
