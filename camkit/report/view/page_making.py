"""`camkit.view`: results of `camkit process` on one page that needs no other file."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.field_types import checked
from camkit.report.pages.page import Page, Words, to_html
from camkit.report.view.picture_light import doubt_of
from camkit.report.view.result_page import result_page
from camkit.report.view.result_search import find_results
from camkit.runtime.files.in_memory import FilePath, list_paths, optional_path
from camkit.runtime.output.part_file import refuse_existing, write_together

MOST_MB: Final = 150
SUFFIXES: Final = frozenset({".html", ".htm"})
_BYTES_PER_MB: Final = 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewPage:
    """The page that was written.

    Attributes:
        path: Its file.
        results: The results on it, in their order.
        megabytes: Its size in MB.
        notes: What is doubtful of the results; it stands on the page too.
    """

    path: Path
    results: tuple[Path, ...]
    megabytes: float
    notes: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON values."""
        return {
            "path": str(self.path),
            "results": [str(path) for path in self.results],
            "megabytes": round(self.megabytes, 2),
            "notes": list(self.notes),
        }


@checked
def view(
    results: Sequence[FilePath] | FilePath,
    out: FilePath,
    *,
    before_file: FilePath | None = None,
    crops: Sequence[tuple[int, int]] = (),
    overwrite: bool = False,
) -> ViewPage:
    """Write a page that shows results of `process`: before and after, exposure, depth, facts.

    Args:
        results: Pictures (EXR, TIFF, PNG, JPEG, linear DNG) or archives of photons (NPZ) with the
            sidecars beside them, the sidecars, or folders of them.
        out: The page to write, one file NAME.html.
        before_file: Picture or capture that stands on the left of the slider, for one picture;
            None for the capture that the sidecar names, developed alone.
        crops: (x, y) in px of parts to show at 100 %, beside those that are chosen.
        overwrite: Whether a page that exists is replaced.

    Raises:
        DecodeError: If a result cannot be read; names it.
        ContractError: If the page exists, is not NAME.html or would be larger than `MOST_MB`, a
            part lies outside, or `before_file` fits no result.
    """
    path = Path(out)
    if (
        path.suffix.lower() not in SUFFIXES
    ):  # of no result or capture, which a page must not replace
        raise ContractError(f"the page must be named NAME.html; got {path}")
    refuse_existing([path], overwrite=overwrite)
    viewed = find_results(list_paths(results))
    if not viewed:
        raise ContractError("there is no result to show; give pictures, sidecars or folders")
    if before_file is not None and len(viewed) > 1:
        raise ContractError(
            f"{option_text('before_file')} is for one result; there are {len(viewed)}"
        )
    file = optional_path(before_file)
    if file is not None:
        notes = (*viewed[0].notes, *doubt_of(file, viewed[0]))
        viewed = [replace(viewed[0], notes=notes)]
    page = result_page(viewed, file, crops, most_bytes=MOST_MB * 10**6)
    text = _with_size(page)
    megabytes = len(text) / _BYTES_PER_MB
    write_together({path: text})
    return ViewPage(
        path=path,
        results=tuple(one.path for one in viewed),
        megabytes=megabytes,
        notes=tuple(f"{one.path.name}: {note}" for one in viewed for note in one.notes),
    )


def _with_size(page: Page) -> bytes:
    """Return a page that states its own size."""
    size = len(to_html(page).encode()) / _BYTES_PER_MB
    note = f"This page has {size:.1f} MB and needs no other file and no network."
    return to_html(replace(page, lead=[*page.lead, Words(note, "small")])).encode()
