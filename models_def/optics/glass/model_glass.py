"""Glasses known only by their index and Abbe number: what a lens file calls a model glass.

Two strict names, both kept to the last bit in TOML:

- `model:n_d,V_d` or `model:n_d,V_d,dP`: the index at 587.56 nm, V_d = (n_d - 1) / (n_F - n_C) and
  the deviation dP of the partial dispersion P_gF from Schott's normal line (0 if left out), met
  exactly by Conrady's formula. V_d = 0 means no dispersion. Against Schott's 160 glasses it is off
  by 2e-5 (median; 1.2e-4 for 95 of 100) at 700 nm and by 1e-4 (5e-4) at 436 nm.
- `cauchy:n_D,V`: two terms of Cauchy, as Sun 2021 has it, with the sodium line D at 589.3 nm. In
  the same comparison off by 1.2e-4 (9e-4) at 700 nm and 3.5e-4 (3.2e-3) at 436 nm.
"""

import math
from typing import Final

from camkit.errors import ContractError
from camkit.models_def.optics.glass.dispersion import C_LINE_UM, D_LINE_UM, F_LINE_UM
from camkit.models_def.optics.glass.material import Glass

MODEL_PREFIX: Final = "model:"
CAUCHY_PREFIX: Final = "cauchy:"

SODIUM_LINE_UM: Final = 0.5893
CAUCHY_F_UM: Final = 0.4861
CAUCHY_C_UM: Final = 0.6563

_G_LINE_UM: Final = 0.4358343
_NORMAL_LINE: Final = (0.6438, -0.001682)
_RANGE_UM: Final = (0.36, 1.1)


def model_glass(index_d: float, abbe_number: float, deviation: float = 0.0) -> Glass:
    """Make a glass from n_d and V_d.

    Args:
        index_d: At 587.56 nm.
        abbe_number: V_d; 0 for no dispersion.
        deviation: Of P_gF from the normal line.

    References: Conrady's formula n = n_0 + A / w + B / w^3.5; normal line P_gF = 0.6438 -
        0.001682 V_d of Schott TIE-29.
    """
    if not (1 <= index_d <= 10 and 0 <= abbe_number <= 1e6 and abs(deviation) < 1):
        raise ContractError(
            f"a model glass needs an index of 1..10, an Abbe number >= 0 and a deviation of P_gF "
            f"below 1; got {index_d}, {abbe_number}, {deviation}"
        )
    numbers = [repr(float(index_d)), repr(float(abbe_number))]
    name = MODEL_PREFIX + ",".join([*numbers, repr(float(deviation))] if deviation else numbers)
    if abbe_number == 0:
        return Glass(name=name, formula="constant", coefficients=(index_d,), source="model glass")
    return Glass(
        name=name,
        formula="conrady",
        coefficients=_conrady_terms(index_d, abbe_number, deviation),
        source="model glass: Conrady's formula through n_d, V_d and P_gF",
        range_um=_RANGE_UM,
    )


def _conrady_terms(
    index_d: float, abbe_number: float, deviation: float
) -> tuple[float, float, float]:
    def step(power: float, short_um: float, long_um: float) -> float:
        return math.pow(short_um, power) - math.pow(long_um, power)

    spread = (index_d - 1) / abbe_number
    partial = _NORMAL_LINE[0] + _NORMAL_LINE[1] * abbe_number + deviation
    lines = (F_LINE_UM, C_LINE_UM), (_G_LINE_UM, F_LINE_UM)
    (a, b), (c, d) = [[step(power, *pair) for power in (-1, -3.5)] for pair in lines]
    first = spread * (d - partial * b) / (a * d - b * c)
    second = spread * (partial * a - c) / (a * d - b * c)
    return index_d - first / D_LINE_UM - second / D_LINE_UM**3.5, first, second


def cauchy_glass(
    name: str, *, index_d: float, abbe_number: float, source: str = "Sun 2021, eq. (6.8)"
) -> Glass:
    """Make a two-term Cauchy glass from its sodium-line index and Abbe number.

    References: Sun 2021, eq. (6.7) and (6.8); D is 589.3 nm, F 486.1 nm, C 656.3 nm.
    """
    if not (1 < index_d < math.inf and 0 < abbe_number < math.inf):
        raise ContractError(f"need index > 1 and Abbe number > 0; got {index_d}, {abbe_number}")
    spread = abbe_number * (CAUCHY_F_UM**-2 - CAUCHY_C_UM**-2)
    b = (index_d - 1) / spread
    a = index_d - b / SODIUM_LINE_UM**2
    return Glass(
        name=name, formula="cauchy", coefficients=(a, b), source=source, range_um=_RANGE_UM
    )


def parse_model_name(name: str) -> Glass | None:
    """Return the glass of a name that starts with `model:` or `cauchy:`, or None.

    Raises:
        ContractError: If what follows is not two numbers (three for `model:`).
    """
    for prefix, counts in ((MODEL_PREFIX, (2, 3)), (CAUCHY_PREFIX, (2,))):
        if not name.startswith(prefix):
            continue
        try:
            numbers = [float(word) for word in name.removeprefix(prefix).split(",")]
        except ValueError:
            numbers = []
        if len(numbers) not in counts:
            raise ContractError(
                f"a model glass is written {prefix}INDEX,ABBE (as model:1.5168,64.17); got {name!r}"
            )
        if prefix == MODEL_PREFIX:
            return model_glass(*numbers)
        index_d, number = numbers
        return cauchy_glass(f"{prefix}{index_d!r},{number!r}", index_d=index_d, abbe_number=number)
    return None
