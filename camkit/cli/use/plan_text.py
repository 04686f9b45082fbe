"""Plans of captures as JSON or as lines for people, for `plan` and `process --dry-run`."""

import json
import logging
from collections.abc import Sequence
from contextlib import closing
from typing import TYPE_CHECKING, Any, Final

from camkit.cli.say import say
from camkit.errors import BundleError, CamkitError, ContractError, unexpected
from camkit.progress import counted

if TYPE_CHECKING:
    from camkit.runtime.batch import Pipelines, Task
    from camkit.runtime.capture import MosaicOptions
    from camkit.runtime.options import Options
    from camkit.runtime.write_options import WriteOptions

logger = logging.getLogger(__name__)

OVERWRITES: Final = "process would refuse to overwrite the capture itself: choose an --out-dir"


def print_plans(
    files: Sequence[str],
    bundle: str | None,
    options: "Options",
    write: "WriteOptions",
    headerless: "MosaicOptions | None",
    *,
    as_json: bool,
) -> bool | None:
    """Print the plans of all inputs.

    Returns:
        Whether all of it could be done; None where nothing matches.

    Raises:
        BundleError: If the bundle that was named is refused.
    """
    from camkit.runtime.batch import Pipelines, expand, kind_of_run, list_tasks, unmatched_text

    pipelines = Pipelines(options)
    kind = kind_of_run(bundle, options, pipelines)
    done = True
    unmatched: list[str] = []
    sources = expand(files, kind, options.halves, unmatched.append)
    if not sources:
        return None
    if unmatched:
        say(f"camkit: {unmatched_text(unmatched)}", err=True)
    tasks = list_tasks(
        sources, bundle=bundle, write=write, options=options, kind=kind, writes=False
    )
    for task in counted(tasks, "planning", "captures"):
        facts: dict[str, Any] = {"input": str(task.source), "output": str(task.target)}
        try:
            facts |= _planned(task, pipelines, write, headerless)
            if task.own_files:
                facts["warnings"].append(OVERWRITES)
        except CamkitError as error:
            if bundle is not None and isinstance(error, BundleError):
                raise
            facts |= {"status": "failed", "error": str(error)}
            done = False
        except Exception as error:
            logger.debug("%s failed", task.source, exc_info=error)
            facts |= {"status": "failed", "error": unexpected(error)}
            done = False
        say(json.dumps(facts) if as_json else "\n".join(plan_lines(facts)))
    return done


def _planned(
    task: "Task",
    pipelines: "Pipelines",
    write: "WriteOptions",
    headerless: "MosaicOptions | None",
) -> dict[str, Any]:
    from camkit.runtime.development import begin

    if task.refusal is not None:
        raise ContractError(task.refusal)
    pipeline = pipelines.get(task.bundle, task.source)
    with closing(pipeline.read(task.source, headerless)) as capture:
        planned = begin(pipeline, capture, write).planned()
    return {"status": "planned", "bundle": task.bundle, **planned}


def plan_lines(facts: dict[str, Any]) -> list[str]:
    """Return a plan as lines for people."""
    lines = [f"{facts['input']} -> {facts['output']}"]
    if facts["status"] == "failed":
        return [*lines, f"  failed: {facts['error']}"]
    lines.append(f"  status: planned, bundle {facts['bundle']}")
    if "depth" in facts.get("plan", {}):
        lines.append(f"  kernels: {facts['plan']['depth']}")
    if "network" in facts.get("plan", {}):
        network = facts["plan"]["network"]
        lines.append(f"  network: {network['dtype']} on {network['provider']}")
        lines.extend(f"  proved: {p['verdict']}" for p in network.get("proof", {}).values())
    for decision in facts["decisions"]:
        saving = decision["saving_s"] or 0.0
        lines.append(f"  {decision['what']}: {decision['choice']} ({decision['reason']})")
        if saving or decision["cost_db"]:
            lines.append(f"    saves {saving:.2f} s, costs {decision['cost_db']:.3f} dB")
    estimate = facts["estimate"]
    if estimate is not None:
        lines.append(f"  about {estimate['seconds']:.1f} s, {estimate['peak_mb']:.0f} MB")
    return [*lines, *(f"  note: {warning}" for warning in facts["warnings"])]
