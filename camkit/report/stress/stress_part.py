"""Part of a kind of camera in `camkit stress`."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from camkit.bundle.reader import Bundle
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import stress_scenes
from camkit.report.stress.score import judge_of
from camkit.report.stress.verdict import Examiner


@dataclass(frozen=True, slots=True, kw_only=True)
class StressPart:
    """A kind of camera under stress; as it is, one whose captures are photographs.

    Attributes:
        scenes: (bundle, how many, folder of pictures or None) -> what is photographed, named.
        examiner: (bundle, sizes of its networks, another bundle to compare with or None) -> what
            restores captures and judges what came out.
        scenarios: Of its own, beside those that serve every camera.
    """

    scenes: Callable[[Bundle, int, Path | None], tuple[Any, ...]] = stress_scenes
    examiner: Callable[[Bundle, tuple[str, ...], Bundle | None], Examiner] = judge_of
    scenarios: tuple[Scenario, ...] = ()
