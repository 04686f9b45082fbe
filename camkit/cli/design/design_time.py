"""Functions that the design-time commands share: the need of torch, existing files, reports."""

import json
from collections.abc import Mapping

from camkit.cli.say import say
from camkit.models_def.face.torch_need import require_torch
from camkit.runtime.output.part_file import refuse_existing

__all__ = ["print_report", "refuse_existing", "require_torch"]


def print_report(report: Mapping[str, object], as_json: bool) -> None:
    """Print a flat report for people, or as one JSON object."""
    if as_json:
        say(json.dumps(report))
        return
    width = max(map(len, report), default=0)
    for name, value in report.items():
        say(f"{name:<{width}}  {value}")
