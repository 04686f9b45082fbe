"""The child of `checkout.Worker`: a job per line of stdin, its answer as a line of stdout.

A job names the `capture` (a file, or bundle and name of a golden case), the `bundle` or None, the
`kind` and the `options` of `camkit.load`. The answer holds hashes, plan, warnings and sections, and
the seconds; or the message by which it was refused.
"""

import json
import os
import sys
import time
import zipfile
from pathlib import Path
from typing import Any

import safetensors.numpy

import camkit
from tools.evidence.samples import array_hash


def main() -> None:
    """Process jobs until stdin ends; what libraries print goes to stderr."""
    with os.fdopen(os.dup(1), "w") as answers:
        os.dup2(2, 1)
        answerer = Answerer()
        for line in sys.stdin:
            answers.write(json.dumps(answerer.answer(json.loads(line))) + "\n")
            answers.flush()


class Answerer:
    """Processes captures; keeps the pipeline of the last job."""

    def __init__(self) -> None:
        self._words: Any = None
        self._pipeline: Any = None

    def answer(self, job: dict[str, Any]) -> dict[str, Any]:
        """Return what became of a capture."""
        began = time.perf_counter()
        try:
            pipeline = self._ready(job)
            entry = _golden(pipeline, job) if "case" in job else _product(pipeline, job)
        except camkit.CamkitError as error:
            return {"refused": f"{type(error).__name__}: {error}"}
        entry.setdefault("seconds", time.perf_counter() - began)
        return entry

    def _ready(self, job: dict[str, Any]) -> Any:
        words = (job["bundle"], job.get("kind"), job["options"])
        if words != self._words:
            self._words = None
            self._pipeline = camkit.load(words[0], kind=words[1], **words[2])
            self._words = words
        return self._pipeline


def _product(pipeline: Any, job: dict[str, Any]) -> dict[str, Any]:
    """Plan and process a file: a picture, or the products of a capture of photons."""
    path = Path(job["capture"])
    plan = pipeline.plan(path) if job.get("planned", True) else None
    began = time.perf_counter()
    if job["is_photograph"]:
        output = pipeline.process(path)
        arrays = {"image": output.image}
    else:
        output = pipeline.make(path)
        arrays = dict(output.arrays)
    seconds = time.perf_counter() - began
    return {
        "hashes": {name: array_hash(array) for name, array in arrays.items()},
        "warnings": list(output.warnings),
        "sections": dict(output.sections),
        "plan": plan,
        "seconds": seconds,
    }


def _golden(pipeline: Any, job: dict[str, Any]) -> dict[str, Any]:
    """Process the array of a golden case, as a member of the bundle's file holds it."""
    with zipfile.ZipFile(pipeline.bundle.path) as members:
        tensors = safetensors.numpy.load(members.read("golden.safetensors"))
        cases = {case["name"]: case for case in json.loads(members.read("manifest.json"))["golden"]}
    case = cases[job["case"]]
    balance = case.get("white_balance")
    origin = tuple(case["origin_px"])
    began = time.perf_counter()
    image = pipeline.process_array(
        tensors[f"{case['name']}.capture"],
        iso=case["iso"],
        white_balance=None if balance is None else tuple(balance),
        origin_px=origin,
    )
    return {"hashes": {"image": array_hash(image)}, "seconds": time.perf_counter() - began}


if __name__ == "__main__":
    main()
