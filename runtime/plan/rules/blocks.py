"""The rule for the blocks of the bank that are filtered."""

from typing import Final

from camkit.bundle.stages import Wiener
from camkit.runtime.bank.blocks import cut_block_px, lay_spans
from camkit.runtime.plan.decision import Decision, Subject, Work
from camkit.runtime.plan.idle_blocks import plain_share
from camkit.runtime.plan.ways import runs

ORDER: Final = 30


def decide(subject: Subject, work: Work) -> tuple[Work, Decision | None]:
    """Report the blocks that only plain cells read; their loss is counted with the cells."""
    stage = subject.bundle.manifest.stage(Wiener)
    if stage is None or not runs(subject.bundle.manifest.stages, Wiener, work):
        return work, None
    size_px = subject.height_px, subject.width_px
    block_px = cut_block_px(stage.block_px, stage.overlap_px, size_px)
    rows, columns = (lay_spans(side, block_px, stage.overlap_px) for side in size_px)
    count = len(rows) * len(columns)
    if work.labels is None:
        return work, Decision(what="blocks", choice=f"all {count}", reason="no plain cells")
    reach = max((subject.reach_px(s) for s in work.sizes()), default=0)
    restored = count - round(plain_share(work.labels, reach, rows, columns) * count)
    return work, Decision(
        what="blocks",
        choice=f"{restored} of {count}",
        reason="blocks that only plain cells use are not restored",
    )
