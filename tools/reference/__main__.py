"""Write the pages; see `tools.reference`."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from tools.reference.command_page import command_page
from tools.reference.recipe_page import recipe_page

FOLDER: Final = Path(__file__).resolve().parents[2] / "docs" / "reference"
PAGES: Final[Mapping[str, Callable[[], str]]] = {
    "commands.md": command_page,
    "recipes.md": recipe_page,
}


def main() -> None:
    """Write every page."""
    for name, page in PAGES.items():
        (FOLDER / name).write_text(page(), encoding="utf-8")
        print(f"wrote docs/reference/{name}")


if __name__ == "__main__":
    main()
