"""Which blocks of the bank are filtered."""

from typing import Final

from camkit.bundle.stages import Wiener
from camkit.runtime.bank.blocks import lay_spans
from camkit.runtime.plan.blocks import plain_share
from camkit.runtime.plan.decision import Decision, Subject, Work

ORDER: Final = 30


def decide(subject: Subject, work: Work) -> tuple[Work, Decision | None]:
    """Report the blocks that only plain cells read; their loss is counted with the cells."""
    stage = subject.bundle.manifest.stage(Wiener)
    if stage is None:
        return work, None
    rows = lay_spans(subject.height_px, stage.block_px, stage.overlap_px)
    columns = lay_spans(subject.width_px, stage.block_px, stage.overlap_px)
    count = len(rows) * len(columns)
    if work.labels is None:
        return work, Decision(what="blocks", choice=f"all {count}", reason="no plain cells")
    reach = max((subject.facts(s).reach_px for s in work.sizes()), default=0)
    kept = count - round(plain_share(work.labels, reach, rows, columns) * count)
    return work, Decision(
        what="blocks",
        choice=f"{kept} of {count}",
        reason="blocks that only plain cells read stay as developed",
    )
