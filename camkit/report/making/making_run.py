"""The steps of a camera in their order, within the minutes.

described, frozen, filtered -> OUT, usable   (about two minutes)
fitted -> OUT anew
trained for what is left of the minutes, exported, judged -> OUT, if it beats its filter
page

Not judged, the filter is all.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.bundle.reader import Bundle, open_bundle
from camkit.caller import option_text
from camkit.report.making.camera_judging import FILTER, Judgement, best_size, judge_camera
from camkit.report.making.camera_page import MadeCamera, camera_html
from camkit.report.making.camera_steps import FILTER_BUNDLE, LENS, NETWORK_BUNDLE, CameraSteps
from camkit.report.making.page_parts import layout_of, pictures_of, seconds_of
from camkit.runtime.output.part_file import write_together
from camkit.runtime.plan.decision import DEVELOP
from camkit.runtime.raw import file_sha256

PAGE_SUFFIX: Final = ".html"
FINISHED: Final = "finished"
LEAST_FIT_S: Final = 240.0
"""Left of the minutes, from which fitting the bank leaves something to train with."""
LAST_S: Final = 100.0
"""Kept for export and judging."""
LEAST_TRAINING_S: Final = 60.0

Tell = Callable[[str], object]


class Making:
    """The steps of a camera in their order."""

    def __init__(self, steps: CameraSteps, out: Path, tell: Tell) -> None:
        self._steps, self._out, self._tell = steps, out, tell
        self._work, self._wish = steps.work, steps.wish

    def run(self, *, judge: bool = True) -> dict[str, Any]:
        """Make the camera; return what is known of it. Not judged, it has no page."""
        steps, work = self._steps, self._work
        finished = self._finished()
        if finished is not None:
            self._tell(
                f"{finished['bundle']} is finished, and its page {finished['page']}: nothing is "
                f"done anew ({option_text('overwrite')} begins anew)"
            )
            return finished
        facts = work.step("described", steps.describe)
        for text in facts["notes"]:
            self._tell(text)
        if not self._wish.is_measured:
            frozen = work.step("frozen", steps.freeze)
            self._tell(f"kernels of {frozen['side_px']} px hold {frozen['energy_kept']:.1%}")
        work.step("filtered", steps.export_filter)
        last = judge and not self._wish.minutes
        later = "; what follows is judging for the page" if last else ""
        self._ship(FILTER_BUNDLE, f"its filter restores, usable now{later}")
        is_grey = facts["channels"] == 1
        fits = not is_grey and not facts["is_grid"]
        if fits and (self._left_s() > LEAST_FIT_S or work.is_done("fitted")):
            fitted = work.step("fitted", steps.fit_bank)
            self._ship(FILTER_BUNDLE, f"colours restored together: {fitted['gain_db']:+.2f} dB")
        elif fits and self._wish.minutes:
            self._tell("colours are not restored together: that takes four minutes")
        if is_grey and self._wish.minutes:
            self._tell("networks are trained on three colours; a grey camera has its filter alone")
        if not judge:
            return self._result(open_bundle(self._out), {}, None)
        judged = self._judged(FILTER_BUNDLE) if is_grey else self._with_network()
        gain_db, error_db = judged[FILTER].gain_over(judged[DEVELOP])
        if gain_db <= error_db:
            self._tell(
                f"the filter does not surely beat developing alone ({gain_db:+.2f} +- "
                f"{error_db:.2f} dB): the lens is sharper than the pixels, or its copies differ "
                "too much"
            )
        bundle = open_bundle(self._out)
        page = self._out.with_suffix(PAGE_SUFFIX)
        write_together({page: self._page(bundle, judged).encode()})
        result = self._result(bundle, judged, page)
        work.step(FINISHED, lambda: {"result": result, "sha256": self._digests(page)})
        return result

    def _finished(self) -> dict[str, Any] | None:
        """Return the result of an earlier call whose files are there as it wrote them."""
        if not self._work.is_done(FINISHED):
            return None
        earlier = self._work.step(FINISHED, dict)
        is_there = earlier["sha256"] == self._digests(self._out.with_suffix(PAGE_SUFFIX))
        return dict(earlier["result"]) if is_there else None

    def _digests(self, page: Path) -> dict[str, str]:
        """Return path -> hash of the bundle and the page that are there."""
        paths = (path for path in (self._out, page) if path.is_file())
        return {str(path): file_sha256(path) for path in paths}

    def _left_s(self) -> float:
        return 60 * self._wish.minutes - self._work.spent_s()

    def _with_network(self) -> Mapping[str, Judgement]:
        """Train a network if minutes are left, and ship it if it beats the filter."""
        steps, work = self._steps, self._work
        training_s = self._left_s() - LAST_S
        if training_s < LEAST_TRAINING_S and not work.is_done("trained"):
            if self._wish.minutes:
                self._tell("no minutes are left to train a network")
            return self._judged(FILTER_BUNDLE)
        trained = work.step("trained", lambda: steps.train(training_s / 60))
        self._tell(f"network {self._wish.size}: {trained['steps']} steps")
        work.step("exported", steps.export_network)
        judged = self._judged(NETWORK_BUNDLE)
        size = self._wish.size
        gain_db, error_db = judged[size].gain_over(judged[FILTER])
        line = f"network {size}: {gain_db:+.2f} +- {error_db:.2f} dB over the filter"
        if best_size(judged, [size]) is None:
            self._tell(f"{line}: it stays out of the bundle; train for more minutes")
        else:
            self._ship(NETWORK_BUNDLE, line)
            for text in broken_laws(open_bundle(self._out)):
                self._tell(text)
        return judged

    def _judged(self, name: str) -> Mapping[str, Judgement]:
        def judge() -> dict[str, Any]:
            bundle = open_bundle(self._work.path(name))
            judged = judge_camera(bundle, self._wish.valid, self._work.folder)
            return {"methods": {method: asdict(one) for method, one in judged.items()}}

        facts = self._work.step("judged", judge)
        return {
            method: Judgement(psnr_db=tuple(one["psnr_db"]), scenes=tuple(one["scenes"]))
            for method, one in facts["methods"].items()
        }

    def _ship(self, name: str, line: str) -> None:
        self._steps.ship(name, self._out)
        self._tell(f"{self._out}: {line} ({self._work.spent_s():.0f} CPU-s so far)")

    def _page(self, bundle: Bundle, judged: Mapping[str, Judgement]) -> str:
        return camera_html(
            MadeCamera(
                bundle=bundle,
                facts=self._work.step("described", self._steps.describe),
                judged=judged,
                pictures=pictures_of(bundle, self._wish.valid, self._work.folder),
                seconds=seconds_of(bundle),
                steps=self._work.seconds(),
                layout=None if self._wish.is_measured else layout_of(self._work.path(LENS)),
            )
        )

    def _result(
        self, bundle: Bundle, judged: Mapping[str, Judgement], page: Path | None
    ) -> dict[str, Any]:
        return {
            "bundle": str(self._out),
            "page": None if page is None else str(page),
            "sizes": list(bundle.manifest.sizes),
            "psnr_db": {m: round(float(np.mean(j.psnr_db)), 3) for m, j in judged.items()},
            "over_filter_db": {
                m: [round(v, 3) for v in j.gain_over(judged[FILTER])]
                for m, j in judged.items()
                if m != FILTER
            },
            "cpu_s": self._work.seconds(),
        }


def broken_laws(bundle: Bundle) -> list[str]:
    """Return a line for every law of a picture that a network of a bundle breaks."""
    return [
        f"network {size} breaks the law {name}: {law.worst:.3g}, admitted are {law.limit:.3g}"
        for size, laws in (bundle.manifest.laws or {}).items()
        for name, law in laws.items()
        if not law.kept
    ]
