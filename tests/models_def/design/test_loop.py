import math
from dataclasses import replace
from typing import Any

import pytest
import torch

from camkit.models_def.design.assembly import parts_of
from camkit.models_def.design.design_recipe import DesignRecipe, to_design
from camkit.models_def.design.loop import DesignLoop
from camkit.models_def.design.loss import design_loss
from camkit.models_def.design.shipped_camera import Knowledge


def make_loop(recipe: DesignRecipe) -> DesignLoop:
    return DesignLoop(parts_of(recipe), recipe.schedule)


def finish(loop: DesignLoop, last_step: int | None = None) -> list[float]:
    return [moment.valid_db for moment in loop.run(last_step)]


def test_a_resumed_design_ends_in_the_same_bits(recipe: DesignRecipe) -> None:
    whole = make_loop(recipe)
    finish(whole)
    first = make_loop(recipe)
    finish(first, last_step=3)
    second = make_loop(recipe)
    second.load(first.state())
    finish(second)
    assert second.step == whole.step == 6
    assert torch.equal(second.parts.lens.moves, whole.parts.lens.moves)
    assert whole.parts.network is not None
    assert second.parts.network is not None
    pairs = zip(whole.parts.network.parameters(), second.parts.network.parameters(), strict=True)
    assert all(torch.equal(one, other) for one, other in pairs)


def test_the_lens_is_held_at_first_and_frozen_at_last(recipe: DesignRecipe) -> None:
    schedule = replace(recipe.schedule, steps=6, hold_steps=2, freeze_share=1 / 3)
    loop = make_loop(replace(recipe, schedule=schedule))
    seen = []
    for step in range(1, 7):
        finish(loop, last_step=step)
        seen.append(loop.parts.lens.moves.detach().clone())
    assert not seen[1].any()
    assert seen[2].any()
    assert not torch.equal(seen[2], seen[3])
    assert torch.equal(seen[3], seen[5])


def test_without_a_network_the_lens_waits_for_none(recipe: DesignRecipe) -> None:
    schedule = replace(recipe.schedule, hold_steps=2)
    network = replace(recipe.network, name="", config={})
    loop = make_loop(replace(recipe, schedule=schedule, network=network))
    finish(loop, last_step=1)
    assert bool(loop.parts.lens.moves.detach().any())


def test_a_rate_of_zero_trains_the_network_alone(recipe: DesignRecipe) -> None:
    schedule = replace(recipe.schedule, lens_rate=0.0, hold_steps=0)
    loop = make_loop(replace(recipe, schedule=schedule))
    network = loop.parts.network
    assert network is not None
    before = [p.detach().clone() for p in network.parameters()]
    finish(loop)
    assert not loop.parts.lens.moves.any()
    assert any(not torch.equal(a, b) for a, b in zip(before, network.parameters(), strict=True))


def test_a_defocused_lens_is_brought_back_by_its_pictures(recipe: DesignRecipe) -> None:
    schedule = replace(
        recipe.schedule, steps=30, hold_steps=0, lens_rate=0.3, batch=3, valid_steps=5
    )
    front = replace(recipe.front, kind="wiener")
    network = replace(recipe.network, name="", config={})
    loop = make_loop(replace(recipe, schedule=schedule, front=front, network=network))
    with torch.no_grad():
        # half a millimetre out of focus
        loop.parts.lens.begin[-1] += 0.25
    begin = loop.judge().valid_db
    assert max(finish(loop)) > begin + 1.0


def test_where_captures_are_judged_the_best_has_the_least_loss(recipe: DesignRecipe) -> None:
    optics = replace(recipe.optics, object_distances_mm=(700.0, 1000.0), focus_distance_mm=1000.0)
    judged = replace(
        recipe,
        optics=optics,
        loss=replace(recipe.loss, kind="edof", reference_depth=1),
        network=replace(recipe.network, name="", config={}),
        schedule=replace(recipe.schedule, steps=4, hold_steps=0, lens_rate=0.5, valid_steps=1),
    )
    loop = make_loop(judged)
    merits = []
    for step in range(5):
        finish(loop, last_step=step)
        merits.append(loop.best_merit if step else -math.inf)
        with torch.no_grad():
            kernels, penalty = loop.parts.lens()
            known = Knowledge(kernels=kernels.float())
            losses = [
                float(design_loss(judged.loss, *loop._pictures(batch, known)))
                for batch in loop._valid
            ]
        here = -sum(losses) / len(losses) - judged.schedule.penalty_weight * float(penalty)
        if step:
            assert merits[-1] == pytest.approx(max(merits[-2], here), abs=1e-5)


def test_a_front_that_is_told_no_depth_filters_with_the_mean_kernel(recipe: DesignRecipe) -> None:
    optics = replace(recipe.optics, object_distances_mm=(600.0, 1000.0), focus_distance_mm=1000.0)
    told = replace(
        recipe,
        optics=optics,
        front=replace(recipe.front, kind="wiener"),
        network=replace(recipe.network, name="", config={}),
    )
    untold = replace(told, front=replace(told.front, depth_known=False))
    known, mean = make_loop(told), make_loop(untold)
    assert known.judge().valid_db > mean.judge().valid_db
    with torch.no_grad():
        kernels = mean.parts.lens()[0].float()
        same = Knowledge(kernels=kernels.mean(0, keepdim=True).expand_as(kernels))
        # where all depths have one kernel there is nothing to be told
        batch = mean._valid[0]
        one, other = (loop._pictures(batch, same)[0] for loop in (known, mean))
    torch.testing.assert_close(one, other)


def test_light_beyond_the_window_is_counted(recipe: DesignRecipe) -> None:
    cut = make_loop(replace(recipe, pixels=replace(recipe.pixels, kernel_px=9))).judge()
    whole = make_loop(replace(recipe, pixels=replace(recipe.pixels, kernel_px=0))).judge()
    assert whole.lost_light < 0.01
    assert cut.lost_light > 0.3


def test_the_best_lens_is_kept_and_put_in_place(recipe: DesignRecipe) -> None:
    schedule = replace(recipe.schedule, lens_rate=3.0, hold_steps=0, steps=4, valid_steps=1)
    loop = make_loop(replace(recipe, schedule=schedule))
    begin = loop.judge().valid_db
    # a rate that ruins the lens
    found = finish(loop)
    loop.take_best()
    assert loop.best_db == max([begin, *found])
    assert loop.judge().valid_db == loop.best_db


def test_a_candidate_loses_to_none_that_was_measured_by_the_same_rule(
    recipe: DesignRecipe,
) -> None:
    """The rule is PSNR less [limits]: a lens outside them may have more dB, and lose."""
    schedule = replace(
        recipe.schedule, lens_rate=0.3, hold_steps=2, steps=6, valid_steps=1, freeze_share=0.0
    )
    broken = replace(recipe, schedule=schedule, limits=replace(recipe.limits, min_bfl_mm=60.0))
    loop = make_loop(broken)
    first = loop.judge()
    assert first.merit < first.valid_db
    moments = [first, *loop.run(last_step=4)]
    resumed = make_loop(broken)
    resumed.load(loop.state())
    moments += resumed.run()
    merits = [moment.merit for moment in moments]
    assert [moment.best_merit for moment in moments] == [
        max(merits[: i + 1]) for i in range(len(merits))
    ]
    assert moments[-1].best_step == moments[merits.index(max(merits))].step
    resumed.take_best()
    assert resumed.judge().merit == max(merits)


def test_with_weights_of_depths_the_least_loss_decides(table: dict[str, Any]) -> None:
    table["optics"]["object_distances_mm"] = [800.0, 1200.0]
    table.pop("limits")
    plain = make_loop(to_design(table))
    by_psnr = plain.judge()
    assert plain.best_merit == by_psnr.valid_db
    merits = []
    for weights in ([0.0, 1.0], [1.0, 0.0]):
        table["loss"]["depth_weights"] = weights
        loop = make_loop(to_design(table))
        assert loop.judge().valid_db == by_psnr.valid_db
        merits.append(loop.best_merit)
    assert -1 < min(merits) < max(merits) < 0
