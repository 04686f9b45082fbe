"""The command line of tools that write pictures."""

import argparse
from collections.abc import Iterable
from pathlib import Path


def read_arguments(title: str, names: Iterable[str], word: str) -> tuple[Path, list[str]]:
    """Return the folder to write to, made, and which pictures: all unless some are named.

    Args:
        title: First line of the help.
        names: All pictures.
        word: One of them in the help, such as PICTURE.
    """
    parser = argparse.ArgumentParser(description=title)
    parser.add_argument("-o", "--out-dir", type=Path, default=Path("docs/images"))
    parser.add_argument("names", nargs="*", default=list(names), metavar=word)
    arguments = parser.parse_args()
    folder: Path = arguments.out_dir
    folder.mkdir(parents=True, exist_ok=True)
    return folder, arguments.names
