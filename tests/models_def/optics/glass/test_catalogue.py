import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.glass.catalogue import (
    GlassCatalogue,
    builtin_catalogues,
    find_glass,
    own_glass,
    preferred_catalogues,
    trade_name_of,
)
from camkit.models_def.optics.glass.dispersion import (
    D_LINE_UM,
    RANGE_TOLERANCE,
    abbe_number,
    refractive_index,
)
from camkit.models_def.optics.glass.material import Glass

STATED_INDEX = 1e-5
STATED_ABBE = 0.0101
"""Makers print V_d with two decimals."""
GLASSES = [glass for catalogue in builtin_catalogues() for glass in catalogue.glasses]
MINE = GlassCatalogue(
    name="mine",
    glasses=(
        Glass(name="F2-mine", formula="constant", coefficients=(1.7,), source="test"),
        Glass(name="X1-mine", formula="constant", coefficients=(1.6,), source="test"),
    ),
)


def test_every_stated_index_and_abbe_number_follow_from_the_coefficients() -> None:
    line = torch.tensor(D_LINE_UM, dtype=torch.float64)
    stated = [glass for glass in GLASSES if glass.stated_index_d is not None]
    assert len(stated) > 1400
    for glass in stated:
        index = float(refractive_index(glass, line))
        assert index == pytest.approx(glass.stated_index_d, abs=STATED_INDEX), glass.name
        assert abbe_number(glass) == pytest.approx(glass.stated_abbe_number, abs=STATED_ABBE)


def test_every_glass_has_a_real_index_over_its_whole_range() -> None:
    for glass in GLASSES:
        low, high = glass.range_um
        waves = torch.linspace(low, high, 20, dtype=torch.float64)
        index = refractive_index(glass, waves)
        assert bool((index > 1).all()), glass.name


def test_every_glass_names_its_source() -> None:
    assert all(glass.source for glass in GLASSES)


def test_strict_names_are_unique_over_all_catalogues() -> None:
    names = [glass.name for glass in GLASSES]
    assert len(set(names)) == len(names)
    assert {"SF1-Schott", "LASFN9-Schott", "Zeonex-E48R-Sultanova2009"} <= set(names)


def test_common_plastics_and_crystals_are_there() -> None:
    wanted = ("PMMA", "PC", "PS", "SAN", "NAS-21", "Zeonex-E48R")
    assert all(find_glass(f"{name}-Sultanova2009") for name in wanted)
    for name in ("COC-Misc", "fused-silica-Malitson1965", "CaF2-Malitson1963"):
        assert find_glass(name).range_um[0] < 0.4


def test_trade_name_of_one_catalogue_stands_for_the_strict_one() -> None:
    assert find_glass("N-BK7") == find_glass("N-BK7-Schott")
    assert find_glass("S-LAH64").name == "S-LAH64-Ohara"


@pytest.mark.parametrize(
    ("name", "offered"),
    [
        ("BK7-Schott", "BK7-Schott1983"),
        ("F2", "F2-Schott or F2-Hikari"),
        ("SF10", "SF10-Schott or SF10-Hikari"),
        ("PMMA", "PMMA-Misc or PMMA-Sultanova2009"),
        ("PC", "PC-Sultanova2009"),
        ("pmma", "PMMA-Sultanova2009"),
        ("PMMA-sultanova2009", "PMMA-Sultanova2009"),
        ("N-BK7-schott", "N-BK7-Schott"),
        ("", "no glass has a name like it"),
        ("UNOBTAINIUM7", "got 'UNOBTAINIUM7'; no glass has a name like it"),
        ("N-BK8", "N-BK7-Schott"),
    ],
)
def test_a_glass_is_never_guessed_but_near_names_are_offered(name: str, offered: str) -> None:
    with pytest.raises(ContractError, match="glass must be a known name") as error:
        find_glass(name)
    assert offered in str(error.value)


def test_n_sf10_is_not_sf10() -> None:
    line = torch.tensor(D_LINE_UM, dtype=torch.float64)
    new, old = find_glass("N-SF10"), find_glass("SF10-Schott")
    assert new.coefficients != old.coefficients
    assert float(refractive_index(new, line)) == pytest.approx(1.72828, abs=STATED_INDEX)
    assert abbe_number(new) - abbe_number(old) == pytest.approx(28.53 - 28.41, abs=0.011)


def test_users_catalogue_is_asked_first() -> None:
    assert find_glass("F2", [MINE]).name == "F2-mine"
    assert find_glass("X1-mine", [MINE]).coefficients == (1.6,)
    assert find_glass("N-BK7", [MINE]).name == "N-BK7-Schott"
    assert own_glass(find_glass("X1", [MINE]), [MINE]) is MINE.glasses[1]
    assert own_glass(find_glass("N-BK7"), [MINE]) is None


def test_users_catalogue_changes_nothing_for_others() -> None:
    find_glass("X1", [MINE])
    with pytest.raises(ContractError, match="X1"):
        find_glass("X1")


def test_catalogue_with_two_glasses_of_one_name_is_refused() -> None:
    with pytest.raises(ContractError, match="two glasses"):
        GlassCatalogue(name="x", glasses=(MINE.glasses[0], MINE.glasses[0]))


def test_wavelength_outside_the_range_is_refused_with_the_range() -> None:
    glass = find_glass("PMMA-Sultanova2009")
    low, high = glass.range_um
    near = [low * (1.001 - RANGE_TOLERANCE), high * (0.999 + RANGE_TOLERANCE)]
    assert bool((refractive_index(glass, torch.tensor(near, dtype=torch.float64)) > 1.4).all())
    for beyond in (low * 0.94, high * 1.06):
        with pytest.raises(ContractError, match=r"0\.4368\.\.1\.052 um"):
            refractive_index(glass, torch.tensor([0.5, beyond], dtype=torch.float64))


@pytest.mark.parametrize(
    ("name", "code"),
    [
        ("BK7", 517642),
        ("FK5", 487704),
        ("K5", 522595),
        ("BAK1", 573575),
        ("SK2", 607567),
        ("SK4", 613586),
        ("PSK3", 552635),
        ("KF9", 523515),
        ("LAK9", 691547),
        ("SSK4", 618551),
        ("BAF4", 606439),
        ("LAFN2", 744447),
        ("SF8", 689312),
    ],
)
def test_glass_of_1983_has_the_index_and_abbe_number_of_its_six_digits(name: str, code: int):
    glass = find_glass(f"{name}-Schott1983")
    index = float(refractive_index(glass, torch.tensor(D_LINE_UM, dtype=torch.float64)))
    assert index == pytest.approx(1 + code // 1000 / 1000, abs=6e-4)
    assert abbe_number(glass) == pytest.approx(code % 1000 / 10, abs=0.17)


def test_glasses_of_1983_are_those_that_are_made_no_more() -> None:
    assert find_glass("BK7").name == "BK7-Schott1983"
    today = {c.name: c for c in builtin_catalogues()}["Schott"]
    old = {c.name: c for c in builtin_catalogues()}["Schott1983"]
    assert len(old.glasses) > 100
    assert not any(today.with_trade_name(g.name.rpartition("-")[0]) for g in old.glasses)


def test_an_old_glass_has_the_coefficients_of_its_successor_only_where_both_are_one() -> None:
    assert find_glass("BK7").coefficients == find_glass("N-BK7").coefficients
    assert find_glass("BK7").range_um == find_glass("N-BK7").range_um
    assert find_glass("LAK9-Schott1983").formula == "buchdahl"


@pytest.mark.parametrize(
    ("name", "code"),
    [
        ("SK1", 610567),
        ("F15", 606378),
        ("SSK4A", 618551),
        ("BAF9", 643480),
        ("K11", 500614),
        ("LAKN14", 697554),
        ("SF18", 722293),
        ("LAF9", 795284),
        ("FK1", 471673),
        ("KF1", 540511),
        ("BALF6", 589530),
        ("LLF4", 561452),
        ("LF2", 589410),
        ("SF7", 640346),
        ("KZF1", 551496),
        ("SF3", 740282),
    ],
)
def test_old_glass_has_the_index_and_abbe_number_of_its_six_digits(name: str, code: int) -> None:
    """The six digits by which makers and patents know these glasses."""
    schott = preferred_catalogues("schott")
    glass = find_glass(name, preferred=schott)
    assert glass.name.rpartition("-")[2] in ("Schott1983", "SchottObsolete")
    index = float(refractive_index(glass, torch.tensor(D_LINE_UM, dtype=torch.float64)))
    assert index == pytest.approx(1 + code // 1000 / 1000, abs=6e-4)
    assert abbe_number(glass) == pytest.approx(code % 1000 / 10, abs=0.17)


def test_no_catalogue_of_former_glasses_doubles_another_of_its_maker() -> None:
    catalogues = preferred_catalogues("schott")
    assert [c.name for c in catalogues] == ["Schott", "Schott1983", "SchottObsolete"]
    names = [trade_name_of(glass) for c in catalogues for glass in c.glasses]
    assert len(names) == len(set(names))


def test_preferred_catalogues_decide_in_their_order() -> None:
    for makers, name in (("schott,hikari", "F2-Schott"), ("hikari,schott", "F2-Hikari")):
        assert find_glass("F2", preferred=preferred_catalogues(makers)).name == name
    assert preferred_catalogues("Nikon") == preferred_catalogues("hikari")
    assert preferred_catalogues(None) == ()
    with pytest.raises(ContractError, match=r"names some of schott, ohara.*got 'shcott'"):
        preferred_catalogues("hikari,shcott")
    with pytest.raises(ContractError, match="or choose by catalogue"):
        find_glass("F2")


def test_a_preferred_catalogue_does_not_come_before_that_of_the_user() -> None:
    assert find_glass("F2", [MINE], preferred_catalogues("schott")).name == "F2-mine"
