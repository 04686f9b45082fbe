import re
from dataclasses import replace

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.material import BayerMaterial
from camkit.models_def.kinds.bayer.validation import BayerJudge
from camkit.models_def.training.checkpoint import (
    load_network,
    read_checkpoint,
    recipe_of,
    write_checkpoint,
)
from camkit.models_def.training.kind import Score
from camkit.models_def.training.log import plot_logs, read_log
from camkit.models_def.training.trainer import TrainOptions, train
from tests.gaussian_bank import gaussian_bank


def options(folder, **changes):
    return TrainOptions(**({"out_dir": folder, "size": "S", "workers": 0} | changes))


@pytest.fixture(scope="module")
def whole(tmp_path_factory, recipe_path, material):
    """Twelve steps in one go."""
    return train(recipe_path, options(tmp_path_factory.mktemp("whole")), material=material)


def test_resumed_training_equals_uninterrupted_training_to_the_last_bit(
    tmp_path, recipe_path, material, whole
):
    train(recipe_path, options(tmp_path, stop_at_step=6), material=material)
    resumed = train(recipe_path, options(tmp_path, resume=True), material=material)
    one, two = read_checkpoint(whole.checkpoint), read_checkpoint(resumed.checkpoint)
    assert (one.step, two.step) == (12, 12)
    for part in ("weights", "average"):
        a, b = getattr(one, part), getattr(two, part)
        assert all(torch.equal(a[name], b[name]) for name in a)
    moments = [c.optimizer["state"][0]["exp_avg"] for c in (one, two)]
    assert torch.equal(*moments)


def test_training_changes_the_weights_and_the_average_lags(whole):
    saved = read_checkpoint(whole.checkpoint)
    assert any(not torch.equal(saved.weights[n], saved.average[n]) for n in saved.weights)


def test_loss_falls_on_a_tiny_run_without_any_picture(tmp_path, recipe_path, material):
    result = train(recipe_path, options(tmp_path, size="M"), material=material)
    assert result.steps == 60
    assert result.valid_db > result.baselines["wiener"] + 0.05
    assert "no photographs" in read_checkpoint(result.checkpoint).training_data


@pytest.mark.parametrize("budget", ["max_minutes", "max_cpu_minutes"])
def test_a_budget_of_time_ends_a_run_with_its_decay(tmp_path, recipe_path, material, budget):
    given = options(tmp_path, size="M", **{budget: 1e-4})
    assert train(recipe_path, given, material=material).steps < 60


def test_a_session_ends_by_its_own_clock_and_the_schedule_goes_on(tmp_path, recipe_path, material):
    session = options(tmp_path, size="M", session_minutes=1e-4)
    assert train(recipe_path, session, material=material).steps < 60
    assert (
        train(recipe_path, options(tmp_path, size="M", resume=True), material=material).steps == 60
    )


def test_the_cpu_time_of_an_earlier_run_counts(tmp_path, recipe_path, material):
    first = train(recipe_path, options(tmp_path, size="M", stop_at_step=5), material=material)
    spent = first.cpu_s / 60
    given = options(tmp_path, size="M", max_cpu_minutes=spent, resume=True)
    assert train(recipe_path, given, material=material).steps == 5


def test_log_tells_steps_seconds_and_quality_and_can_be_drawn(whole, tmp_path):
    entries = read_log(whole.log)
    assert entries[0]["step"] == 0
    assert entries[-1]["valid_db"] == pytest.approx(whole.valid_db)
    assert all({"step", "seconds", "cpu_s"} <= set(e) for e in entries)
    plot_logs({"S": whole.log}, tmp_path / "chart.png")
    assert (tmp_path / "chart.png").read_bytes()[:4] == b"\x89PNG"


def test_resumed_log_has_each_step_once(tmp_path, recipe_path, material):
    train(recipe_path, options(tmp_path, stop_at_step=6), material=material)
    saved = tmp_path / "tiny_S.pt"
    early = saved.read_bytes()
    train(recipe_path, options(tmp_path, resume=True), material=material)
    saved.write_bytes(early)
    resumed = train(recipe_path, options(tmp_path, resume=True), material=material)
    steps = [e["step"] for e in read_log(resumed.log) if "valid_by_iso" in e]
    assert steps == [6, 12]


def test_broken_log_is_refused(tmp_path):
    path = tmp_path / "x.jsonl"
    path.write_text('{"step": 1}\n{"loss": 2}\n', encoding="utf-8")
    with pytest.raises(ContractError, match="line 2 must be an object with a step"):
        read_log(path)
    path.write_text("{", encoding="utf-8")
    with pytest.raises(ContractError, match="line 1 is not JSON"):
        read_log(path)


def test_checkpoint_with_other_kernels_is_not_resumed(tmp_path, recipe_path, material):
    train(recipe_path, options(tmp_path, stop_at_step=1), material=material)
    other = gaussian_bank(sensor_height_mm=2.0, axis_px=0.9, corner_px=1.7)
    with pytest.raises(ContractError, match="other kernels"):
        train(recipe_path, options(tmp_path, resume=True), material=BayerMaterial(bank=other))


def test_weights_of_another_camera_are_the_first_ones_and_the_card_says_so(
    tmp_path, recipe_path, material, whole
):
    begun = options(tmp_path, start=whole.checkpoint, stop_at_step=1)
    train(recipe_path, begun, material=material)
    first, saved = read_checkpoint(whole.checkpoint), read_checkpoint(tmp_path / "tiny_S.pt")
    moved = max(float((saved.weights[k] - v).abs().max()) for k, v in first.average.items())
    assert 0 < moved < 1.1e-3  # one step away, of half the rate
    assert saved.step == 1
    assert saved.training_data.endswith("; first weights: tiny S, trained on the same")
    train(recipe_path, options(tmp_path, resume=True, stop_at_step=2), material=material)
    assert read_checkpoint(tmp_path / "tiny_S.pt").training_data == saved.training_data


def test_weights_of_another_network_are_refused(tmp_path, recipe_path, material, whole):
    with pytest.raises(ContractError, match="holds another network than the recipe's"):
        train(recipe_path, options(tmp_path, start=whole.checkpoint, size="M"), material=material)
    with pytest.raises(ContractError, match="has begun"):
        options(tmp_path, start=whole.checkpoint, resume=True)


def test_the_average_that_validates_best_is_kept_over_interruptions(
    tmp_path, recipe_path, material, monkeypatch
):
    decibels = {3: 20.0, 4: 22.0, 5: 19.0, 6: 21.5}
    scores = iter(decibels.values())
    monkeypatch.setattr(BayerJudge, "score", lambda *_: Score(mean_db=next(scores), parts={}))
    monkeypatch.setattr(BayerJudge, "baselines", lambda _: {})
    for end in decibels:  # each run validates once, at its end
        result = train(
            recipe_path, options(tmp_path, stop_at_step=end, resume=end > 3), material=material
        )
        if end == 4:
            at_best = read_checkpoint(result.checkpoint)
    saved = read_checkpoint(result.checkpoint)
    assert (saved.step, saved.valid_db, saved.best_db, result.valid_db) == (6, 21.5, 22.0, 22.0)
    chosen = load_network(saved).state_dict()
    assert all(torch.equal(chosen[k], v) for k, v in at_best.average.items())
    assert any(not torch.equal(chosen[k], v) for k, v in saved.average.items())


def test_network_from_a_checkpoint_has_the_averaged_weights(whole):
    saved = read_checkpoint(whole.checkpoint)
    network = load_network(saved)
    assert all(torch.equal(v, saved.average[k]) for k, v in network.state_dict().items())
    older = load_network(replace(saved, best={}))  # as checkpoints of before
    assert all(torch.equal(v, saved.average[k]) for k, v in older.state_dict().items())
    planes = torch.from_numpy(np.random.default_rng(0).random((1, 6, 32, 32), dtype=np.float32))
    assert network(planes).shape == (1, 3, 32, 32)
    wrong = replace(saved, average={}, best={})
    with pytest.raises(ContractError, match="do not fit"):
        load_network(wrong)


def test_damaged_checkpoints_are_refused(tmp_path, whole):
    with pytest.raises(ContractError, match="cannot read checkpoint"):
        read_checkpoint(tmp_path / "none.pt")
    path = tmp_path / "x.pt"
    path.write_bytes(whole.checkpoint.read_bytes()[:100])
    with pytest.raises(ContractError, match="no checkpoint"):
        read_checkpoint(path)
    torch.save({"format": 99}, path)
    with pytest.raises(ContractError, match="format 1"):
        read_checkpoint(path)
    torch.save({"format": 1, "step": 3}, path)
    with pytest.raises(ContractError, match="wrong entries"):
        read_checkpoint(path)


def test_checkpoints_of_before_are_read_with_their_camera_and_without_a_role(tmp_path, whole):
    """They carry their recipe as text, with the names of their day."""
    table = torch.load(whole.checkpoint, weights_only=True)
    del table["role"], table["designed"]
    table["recipe_toml"] = table["recipe_toml"].replace("[sensor", "[camera")
    torch.save(table, tmp_path / "old.pt")
    old, saved = read_checkpoint(tmp_path / "old.pt"), read_checkpoint(whole.checkpoint)
    assert (old.role, old.designed) == ("restore", {})
    assert recipe_of(old) == recipe_of(saved)
    assert load_network(old).state_dict().keys() == saved.average.keys()


def test_the_lens_of_older_checkpoints_is_read_as_that_of_new_ones(tmp_path, whole):
    table = torch.load(whole.checkpoint, weights_only=True)
    del table["designed"]
    torch.save(table | {"lens_toml": "name = 'é'"}, tmp_path / "old.pt")
    old = read_checkpoint(tmp_path / "old.pt")
    assert old.designed == {"prescription.toml": "name = 'é'".encode()}


def test_optics_as_designed_go_with_a_checkpoint_byte_by_byte(tmp_path, whole):
    designed = {"plate.toml": b"", "plate.safetensors": bytes(range(256))}
    saved = replace(read_checkpoint(whole.checkpoint), designed=designed)
    write_checkpoint(tmp_path / "plate.pt", saved)
    assert read_checkpoint(tmp_path / "plate.pt").designed == designed


@pytest.mark.parametrize("damaged", [3, {"plate.toml": "text"}, {"plate.toml": torch.zeros(4)}])
def test_optics_that_are_no_bytes_are_refused(damaged, tmp_path, whole):
    table = torch.load(whole.checkpoint, weights_only=True)
    torch.save(table | {"designed": damaged}, tmp_path / "damaged.pt")
    with pytest.raises(ContractError, match="wrong entries: designed"):
        read_checkpoint(tmp_path / "damaged.pt")


def test_interrupted_write_keeps_the_old_checkpoint(tmp_path, whole, monkeypatch):
    path = tmp_path / "x.pt"
    saved = read_checkpoint(whole.checkpoint)
    write_checkpoint(path, saved)

    def fail(*args, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr(torch, "save", fail)
    with pytest.raises(KeyboardInterrupt):
        write_checkpoint(path, replace(saved, step=99))
    assert read_checkpoint(path).step == 12


def test_a_finished_run_is_not_replaced_unasked(tmp_path, recipe_path, material, whole):
    there = options(whole.checkpoint.parent, stop_at_step=1)
    with pytest.raises(ContractError, match="is there already: give resume"):
        train(recipe_path, there, material=material)
    assert read_checkpoint(whole.checkpoint).step == 12
    for _ in range(2):
        train(recipe_path, options(tmp_path, stop_at_step=1, overwrite=True), material=material)
    with pytest.raises(ContractError, match="choose one"):
        options(tmp_path, resume=True, overwrite=True)


def test_patches_that_the_network_cannot_take_are_refused_before_any_tracing(tmp_path, recipe_path):
    odd = tmp_path / "odd.toml"
    text = recipe_path.read_text(encoding="utf-8")
    odd.write_text(re.sub(r"patch_px = \d+", "patch_px = 62", text), encoding="utf-8")
    with pytest.raises(ContractError, match="multiple of 4 for lean_s; got 62"):
        train(odd, options(tmp_path / "out"))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "changes", [{"max_minutes": 0.0}, {"max_cpu_minutes": -1.0}, {"threads": 0}, {"workers": -1}]
)
def test_impossible_options_are_refused(tmp_path, changes):
    with pytest.raises(ContractError, match=r"must be"):
        options(tmp_path, **changes)
