"""The packages that charts, pages and scores of pictures need, and the way to install them.

`camkit process` uses neither, so they are an extra.
"""

from importlib import util
from typing import Final

from camkit.errors import UnsupportedError

INSTALLED_BY: Final = "pip install 'camkit[judge]'"
PACKAGES: Final = {"matplotlib": "matplotlib", "skimage": "scikit-image"}
"""Import name -> name to install."""


def missing_packages() -> list[str]:
    """Return the names of those that are not installed."""
    return [name for module, name in PACKAGES.items() if util.find_spec(module) is None]


def require_judge() -> None:
    """Raise an error that says how to install what is missing.

    Raises:
        UnsupportedError: If matplotlib or scikit-image cannot be imported.
    """
    if missing := missing_packages():
        raise UnsupportedError(
            f"pages, charts and scores of pictures need {' and '.join(missing)}; "
            f"install with: {INSTALLED_BY}"
        )
