from dataclasses import replace

import torch

from camkit.models_def.design.assembly import parts_of
from camkit.models_def.design.loop import DesignLoop
from camkit.models_def.design.recipe import DesignRecipe


def make_loop(recipe: DesignRecipe) -> DesignLoop:
    return DesignLoop(parts_of(recipe), recipe.schedule)


def finish(loop: DesignLoop, until: int | None = None) -> list[float]:
    return [moment.valid_db for moment in loop.run(until)]


def test_a_resumed_design_ends_in_the_same_bits(recipe: DesignRecipe) -> None:
    whole = make_loop(recipe)
    finish(whole)
    first = make_loop(recipe)
    finish(first, until=3)
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
        finish(loop, until=step)
        seen.append(loop.parts.lens.moves.detach().clone())
    assert not seen[1].any()
    assert seen[2].any()
    assert not torch.equal(seen[2], seen[3])
    assert torch.equal(seen[3], seen[5])


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


def test_the_best_lens_is_kept_and_put_in_place(recipe: DesignRecipe) -> None:
    schedule = replace(recipe.schedule, lens_rate=3.0, hold_steps=0, steps=4, valid_steps=1)
    loop = make_loop(replace(recipe, schedule=schedule))
    begin = loop.judge().valid_db
    # a rate that ruins the lens
    found = finish(loop)
    loop.take_best()
    assert loop.best_db == max([begin, *found])
    assert loop.judge().valid_db == loop.best_db
