from pathlib import Path

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from camkit.errors import DecodeError
from camkit.models_def.optics.glass.agf import parse_agf, read_agf
from camkit.models_def.optics.glass.catalogue import find_glass
from camkit.models_def.optics.glass.dispersion import D_LINE_UM, refractive_index

GOOD = """CC my glasses
NM N-BK7 2 517642.251 1.5168 64.17 0 1 -1
GC the usual one
ED 7.1 8.3 2.51 -0.0009 0
CD 1.03961212E+00 6.00069867E-03 2.31792344E-01 2.00179144E-02 1.01046945E+00 1.03560653E+02 0 0 0 0
TD 1.86E-06 1.31E-08 -1.37E-11 4.34E-07 6.27E-10 1.7E-01 2.0E+01
OD 1.0 2.3 1.0 2.3 2.3 -1
LD 3.1E-01 2.5
IT 3.1E-01 2.5E-01 10.0

NM CDS 2 1 1.000000 0.000000 0 0 0
CD 3.9658282 5.580368690E-002 0.18113874 0.233146066
LD 0.51 1.4
"""


def _one(formula: int, coefficients: str) -> str:
    return f"NM X {formula} 0 1.5 60\nCD {coefficients}\nLD 0.2 12\n"


def test_glass_is_read_with_its_range_and_stated_values() -> None:
    glass = parse_agf(GOOD, "my").glasses[0]
    assert glass.name == "N-BK7-my"
    assert glass.coefficients == find_glass("N-BK7-Schott").coefficients
    assert glass.range_um == (0.31, 2.5)
    assert (glass.stated_index_d, glass.stated_abbe_number) == (1.5168, 64.17)
    assert glass.source == "my.agf the usual one"


def test_index_one_stands_for_unknown() -> None:
    glass = parse_agf(GOOD, "my").glasses[1]
    assert glass.stated_index_d is None
    assert glass.stated_abbe_number is None


@pytest.mark.parametrize("encoding", ["utf-16", "latin-1", "utf-8"])
def test_catalogue_is_named_after_its_file(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "my-glass.agf"
    path.write_bytes(GOOD.replace("usual", "üsual").encode(encoding))
    catalogue = read_agf(path)
    assert catalogue.name == "my_glass"
    assert find_glass("CDS", [catalogue]).name == "CDS-my_glass"
    assert "üsual" in catalogue.glasses[0].source


W2 = D_LINE_UM**2
SQUARES = {
    1: ("2.2 -.01 .01 .001 1e-4 1e-5", 2.2 - 0.01 * W2 + 0.01 / W2 + 1e-3 / W2**2 + 1e-4 / W2**3
        + 1e-5 / W2**4),
    2: ("1.1 .01 .2 80 0 0", 1 + 1.1 * W2 / (W2 - 0.01) + 0.2 * W2 / (W2 - 80)),
    4: ("1.1 .1 .1 .02 9", 2.1 + 0.1 * W2 / (W2 - 0.01) + 0.02 / (W2 - 81)),
    6: ("1 .01 .1 .02 .1 80 .1 90", 1 + W2 / (W2 - 0.01) + 0.1 * W2 / (W2 - 0.02)
        + 0.1 * W2 / (W2 - 80) + 0.1 * W2 / (W2 - 90)),
    7: ("2.3 .03 .01 .02", 2.3 + 0.03 / (W2 - 0.01) - 0.02 * W2),
    8: ("1.3 1 .01 .02", 1.3 + W2 / (W2 - 0.01) - 0.02 * W2),
    9: ("1.3 1 .01 .1 80", 1.3 + W2 / (W2 - 0.01) + 0.1 * W2 / (W2 - 80)),
    10: ("2.2 -.01 .01 1e-3 1e-4 1e-5 1e-6 1e-7", 2.2 - 0.01 * W2 + 0.01 / W2 + 1e-3 / W2**2
         + 1e-4 / W2**3 + 1e-5 / W2**4 + 1e-6 / W2**5 + 1e-7 / W2**6),
    11: ("1 .01 .1 .02 .1 80 .1 90 .1 99", 1 + W2 / (W2 - 0.01) + 0.1 * W2 / (W2 - 0.02)
         + 0.1 * W2 / (W2 - 80) + 0.1 * W2 / (W2 - 90) + 0.1 * W2 / (W2 - 99)),
    12: ("2.2 -.01 .01 1e-3 1e-4 1e-5 1e-3 1e-4", 2.2 - 0.01 * W2 + 0.01 / W2 + 1e-3 / W2**2
         + 1e-4 / W2**3 + 1e-5 / W2**4 + 1e-3 * W2**2 + 1e-4 * W2**3),
    13: ("2.2 -.01 -1e-4 .01 1e-3 1e-4 1e-5 1e-6 1e-7", 2.2 - 0.01 * W2 - 1e-4 * W2**2
         + 0.01 / W2 + 1e-3 / W2**2 + 1e-4 / W2**3 + 1e-5 / W2**4 + 1e-6 / W2**5 + 1e-7 / W2**6),
}  # fmt: skip
INDICES = {
    3: ("1.5 .01 .001 -.01 .001 1e-4", 1.5 + 0.01 / (W2 - 0.028) + 0.001 / (W2 - 0.028) ** 2
        - 0.01 * W2 + 0.001 * W2**2 + 1e-4 * W2**3),
    5: ("1.45 .0125 6e-5", 1.45 + 0.0125 / D_LINE_UM + 6e-5 / D_LINE_UM**3.5),
}  # fmt: skip


@pytest.mark.parametrize("formula", range(1, 14))
def test_every_formula_number_means_what_the_format_says(formula: int) -> None:
    if formula in SQUARES:
        text, square = SQUARES[formula]
        expected = square**0.5
    else:
        text, expected = INDICES[formula]
    glass = parse_agf(_one(formula, text), "x").glasses[0]
    line = torch.tensor(D_LINE_UM, dtype=torch.float64)
    assert float(refractive_index(glass, line)) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("CC nothing\n", "no NM line"),
        ("CD 1 2\n", "line 1: CD before"),
        ("NM X\n", "line 1: NM needs"),
        ("NM X 14 0 1.5 60\n", r"line 1: dispersion formula must be 1\.\.13"),
        ("NM X two 0 1.5 60\n", "line 1: expected a number"),
        ("NM X 2 0 1.5 60\nLD 0.3 2\n", "line 1: glass X has no CD"),
        ("NM X 2 0 1.5 60\nCD 1 0.01\n", "line 1: glass X has no LD"),
        ("NM X 2 0 1.5 60\nCD 1 nan\n", "line 2: expected a number"),
        ("NM X 2 0 1.5 60\nCD 1 1e999\n", "line 2: expected a number"),
        ("NM X 2 0 1.5 60\nCD 1 0.01\nLD 2 0.3\n", "line 3: LD needs"),
        ("NM X 2 0 1.5 60\nCD 0 0\nLD 0.3 2\n", "line 1: glass X-x: 0 coefficients"),
        (_one(2, "1 .01") + _one(2, "1 .02"), "line 4: glass X stands already in line 1"),
    ],
)
def test_damaged_catalogue_is_refused_with_its_line(text: str, message: str) -> None:
    with pytest.raises(DecodeError, match=message):
        parse_agf(text, "x")


@given(cut=st.integers(0, len(GOOD)), noise=st.text(max_size=20))
def test_cut_or_spoilt_catalogue_is_read_or_refused(cut: int, noise: str) -> None:
    try:
        catalogue = parse_agf(GOOD[:cut] + noise, "x")
    except DecodeError:
        return
    assert catalogue.glasses
