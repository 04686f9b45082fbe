"""The sensor that a plate is looked at with: that of a recipe."""

from pathlib import Path
from typing import TYPE_CHECKING

from camkit.errors import UnsupportedError

if TYPE_CHECKING:
    from camkit.bundle.sensor import ColorSensor


def recipe_sensor(recipe: Path | None) -> "ColorSensor":
    """Return the sensor of a recipe; duet's where none is named.

    Raises:
        UnsupportedError: If it has no colours.
        ContractError: If the recipe is wrong.
    """
    from importlib import resources

    from camkit.bundle.sensor import ColorSensor
    from camkit.models_def.training.kind import read_recipe

    default = Path(str(resources.files("camkit.models_def.recipes"))) / "duet.toml"
    sensor = read_recipe(default if recipe is None else recipe).sensor
    if not isinstance(sensor, ColorSensor):
        raise UnsupportedError(f"a {sensor.type} sensor has no colours to look at a plate with")
    return sensor
