"""Grooves of a prescription: where walls stand, what is refused, how they travel through files."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.optics.grooves import Grooves, groove_facts, grooved_mm, narrowest_mm
from camkit.models_def.optics.lens_file.zmx_writer import format_zmx
from camkit.models_def.optics.prescription import (
    Surface,
    format_prescription,
    grooves_of,
    parse_prescription,
    read_prescription,
    write_prescription,
)
from camkit.models_def.optics.scaling import scale_lens
from camkit.models_def.optics.spot import chief_heights
from tests.thin_factory import perfect_lens

PARABOLA = Surface(
    curvature_per_mm=0.0, thickness_mm=1.0, even_asphere=(0.01,), semi_diameter_mm=9.9
)


def _cut(**grooves: float | bool) -> Surface:
    return replace(PARABOLA, grooves=Grooves(**grooves))  # type: ignore[arg-type]


def test_walls_of_a_parabola_stand_at_roots_of_whole_numbers() -> None:
    """0.01 r^2 = k 0.1 mm: r = sqrt(10 k)."""
    surface = _cut(depth_um=100.0)
    assert surface.grooves is not None
    facts = groove_facts(surface.profile, surface.grooves)
    assert facts["walls"] == 9
    widths = np.diff(np.sqrt(10 * np.arange(1, 10)))
    assert facts["narrowest_mm"] == pytest.approx(widths.min(), rel=1e-9)


def test_cut_heights_keep_their_sign_and_stay_below_the_depth() -> None:
    height = torch.linspace(-1, 1, 2001, dtype=torch.float64)
    cut = grooved_mm(height, Grooves(depth_um=130.0))
    assert bool((cut * height >= 0).all())
    assert float(cut.abs().max()) < 0.13
    turns = (height - cut) / 0.13
    assert torch.allclose(turns, turns.round(), atol=1e-9)


def test_a_single_groove_has_no_width() -> None:
    surface = _cut(depth_um=900.0)
    assert surface.grooves is not None
    assert math.isinf(narrowest_mm(surface.profile, surface.grooves))
    assert groove_facts(surface.profile, surface.grooves)["narrowest_mm"] is None


@pytest.mark.parametrize(
    ("grooves", "words"),
    [
        ({"depth_um": 0.0}, "groove_depth_um must be > 0"),
        ({"depth_um": math.inf}, "groove_depth_um must be > 0"),
        ({"depth_um": 100.0, "tool_radius_um": -1.0}, "tool_radius_um must be >= 0"),
        ({"depth_um": 0.1}, "narrower than 1 um"),
    ],
)
def test_grooves_that_cannot_be_are_refused(grooves: dict[str, float], words: str) -> None:
    with pytest.raises(ContractError, match=words):
        _cut(**grooves)


def test_grooves_that_the_tool_cannot_cut_are_refused() -> None:
    with pytest.raises(UnsupportedError, match="narrower than the tool"):
        _cut(depth_um=20.0, tool_radius_um=60.0)


def test_grooves_need_a_rim() -> None:
    for rim_mm in (math.inf, 1e300, 3e5):
        with pytest.raises(ContractError, match="finite semi_diameter_mm, at most 1000"):
            replace(PARABOLA, semi_diameter_mm=rim_mm, grooves=Grooves(depth_um=100.0))


def test_a_file_gives_grooves_back(tmp_path: Path) -> None:
    for grooves in (
        Grooves(depth_um=111.65521884554494),
        Grooves(depth_um=100.0, walls=False),
        Grooves(depth_um=100.0, tool_radius_um=16.0),
    ):
        lens = perfect_lens(50.0, 5.0, grooves=grooves)
        write_prescription(lens, tmp_path / "l.toml")
        assert read_prescription(tmp_path / "l.toml") == lens


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("groove_walls = false", "surface 2: groove_walls without groove_depth_um"),
        ("tool_radius_um = 16.0", "surface 2: tool_radius_um without groove_depth_um"),
        ("groove_depth_um = 'x'", "surface 2.groove_depth_um must be a number"),
        (
            "groove_depth_um = 100.0\ngroove_walls = 1",
            "surface 2.groove_walls must be true or false",
        ),
        ("groove_depth_um = 0.05", "surface 2: a groove is narrower than 1 um"),
        (
            "groove_depth_um = 20.0\ntool_radius_um = 90.0",
            "surface 2: a groove of .* um is narrower than the tool",
        ),
    ],
)
def test_wrong_grooves_of_a_file_name_their_surface(line: str, words: str) -> None:
    text = format_prescription(perfect_lens(50.0, 5.0)) + line + "\n"
    with pytest.raises((ContractError, UnsupportedError), match=words):
        parse_prescription(text)


def test_grooves_are_scaled_with_the_lens_and_kept_out_of_zmx() -> None:
    lens = perfect_lens(50.0, 5.0, grooves=Grooves(depth_um=100.0, tool_radius_um=10.0))
    half = scale_lens(lens, 0.5).surfaces[2].grooves
    assert half == Grooves(depth_um=50.0, tool_radius_um=5.0)
    walls = [found["walls"] for found in (*grooves_of(lens), *grooves_of(scale_lens(lens, 0.5)))]
    assert walls[0] == walls[1]
    with pytest.raises(UnsupportedError, match="surface 2 has grooves"):
        format_zmx(lens)


def test_no_wall_takes_a_chief_ray() -> None:
    """Chief rays are references: every field up to 20 degrees has one."""
    lens = perfect_lens(50.0, 5.0, grooves=Grooves(depth_um=50.0))
    plain = perfect_lens(50.0, 5.0)
    slopes = torch.linspace(0, 0.36, 200, dtype=torch.float64)
    moved = chief_heights(lens, slopes) - chief_heights(plain, slopes)
    assert float(moved.abs().max()) < 0.05
