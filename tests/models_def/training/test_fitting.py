"""A kind may bring its own fitter; weights of VGG-19 that nobody looks at are refused."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from camkit.errors import ContractError
from camkit.kinds import Kind
from camkit.models_def.training.fitting import FitRequest, OwnFitting, own_fitting
from camkit.models_def.training.recipe import NetworkRecipe

REQUEST = FitRequest(recipe=None, role="network", entry=NetworkRecipe(network="lean_s"))
GIVEN = FitRequest(
    recipe=None, role="network", entry=NetworkRecipe(network="lean_s"), vgg=Path("vgg19.pth")
)


def test_a_kind_without_fitters_has_that_of_the_house():
    assert own_fitting("bayer", REQUEST) is None
    with pytest.raises(ContractError, match=r"lean_s in the role 'network' .* leave vgg away"):
        own_fitting("bayer", GIVEN)


def test_what_a_kind_brings_is_asked_for_every_role(monkeypatch):
    own = OwnFitting(make=lambda _: None, credit="; by hand")
    asked = []

    def fitting(request):
        asked.append(request)
        return own if request.vgg is not None else None

    part = SimpleNamespace(FITTING=SimpleNamespace(fitting=fitting))
    monkeypatch.setattr(Kind, "part", lambda *_: part)
    assert own_fitting("bayer", GIVEN) is own
    assert own_fitting("bayer", REQUEST) is None
    assert asked == [GIVEN, REQUEST]
