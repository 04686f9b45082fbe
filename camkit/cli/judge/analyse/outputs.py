"""The outputs of a command of `camkit analyse`: a page if asked for, and the printed text."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from camkit.cli.say import say


def deliver(
    record: dict[str, Any],
    page: Path | None,
    html: Callable[[], str],
    text: Callable[[dict[str, Any]], str],
    *,
    as_json: bool,
) -> None:
    """Write the page and print the results.

    Args:
        record: What was found, as plain JSON values.
        page: Where the page goes; None for none.
        html: Gives it; called only where one is asked for.
        text: Gives what is said without --json.
        as_json: Print one object instead.
    """
    if page is not None:
        from camkit.runtime.output.part_file import atomic_output

        page.parent.mkdir(parents=True, exist_ok=True)
        with atomic_output(page) as part:
            part.write_text(html(), encoding="utf-8")
        record = {**record, "page": str(page)}
    say(json.dumps(record, allow_nan=False) if as_json else text(record))
