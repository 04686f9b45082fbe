"""The files of a measurement: refused before any work, written together after it."""

from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from typing import Final

from camkit.errors import ContractError
from camkit.report.judge_need import require_judge
from camkit.runtime.files.in_memory import FilePath, optional_path
from camkit.runtime.output.part_file import refuse_existing, write_together

PAGE: Final = ".html"
KINDS: Final = {
    ".camkit": "a bundle is a CAMKIT file",
    PAGE: "a page is HTML",
    ".safetensors": "a PSF is safetensors",
    ".toml": "a calibration is TOML",
    ".xml": "an entry of lensfun is XML",
}


def check_result(path: FilePath | None, suffix: str, *, overwrite: bool) -> Path | None:
    """Return the path of a result, if one is named.

    Raises:
        ContractError: If its name is of another kind, or it exists and may not be replaced.
        UnsupportedError: If it is a page, and what draws charts is not installed.
    """
    file = optional_path(path)
    if file is not None and file.suffix.lower() != suffix:
        raise ContractError(f"{KINDS[suffix]}; expected a name in {suffix}, got {file}")
    refuse_existing([file], overwrite=overwrite)
    if file is not None and suffix == PAGE:
        require_judge()
    return file


def check_results(
    out: FilePath | None, suffix: str, page: FilePath | None, *, overwrite: bool
) -> tuple[Path | None, Path | None]:
    """Return the paths of a result and of its page; see `check_result`."""
    return (
        check_result(out, suffix, overwrite=overwrite),
        check_result(page, PAGE, overwrite=overwrite),
    )


def write_results(
    files: tuple[Path | None, Path | None], content: Callable[[], bytes], page: Callable[[], str]
) -> None:
    """Write a result and its page where they are named, both or none."""
    out, page_file = files
    contents = {} if out is None else {out: content()}
    if page_file is not None:
        contents[page_file] = page().encode()
    write_together(contents)


def paths_of(files: FilePath | Sequence[FilePath]) -> list[Path]:
    """Return the paths of one file or of several."""
    several = [files] if isinstance(files, str | PathLike) else files
    return [Path(file) for file in several]
