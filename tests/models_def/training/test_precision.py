import pytest
import torch

from camkit.models_def.training.precision import half_precision, multiplies_bfloat16
from camkit.models_def.training.recipe import ScheduleRecipe

CPU = torch.device("cpu")


def claim(monkeypatch, **capabilities):
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: {"avx2": True} | capabilities)


@pytest.mark.parametrize("instructions", ["avx512_bf16", "amx_bf16"])
def test_a_processor_with_instructions_for_bfloat16_uses_them(monkeypatch, instructions):
    claim(monkeypatch, **{instructions: True})
    assert half_precision(ScheduleRecipe(), CPU, 0.5)


def test_a_processor_without_them_computes_in_float32(monkeypatch):
    claim(monkeypatch, avx512_bf16=False)
    assert not half_precision(ScheduleRecipe(), CPU, 0.5)
    assert multiplies_bfloat16(torch.device("cuda"))


def test_float32_is_kept_where_the_schedule_asks_for_it(monkeypatch):
    claim(monkeypatch, amx_bf16=True)
    assert not half_precision(ScheduleRecipe(precision="float32"), CPU, 0.5)
    schedule = ScheduleRecipe(float32_share=0.2)
    assert [half_precision(schedule, CPU, share) for share in (0.0, 0.79, 0.8, 1.0)] == [
        *(True, True, False, False)
    ]
