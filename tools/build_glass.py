"""Rewrite the glass data of camkit from a copy of the refractiveindex.info database (CC0).

    python -m tools.build_glass path/to/database/data-nk
    python -m tools.build_glass --obsolete SCHOTT.AGF
    python -m tools.build_glass --classic robb1983_data_final.txt

The folder is `data-nk` of the database (github.com/polyanskiy/refractiveindex.info-database, also
inside the wheel of `optiland`). Writes one JSON file per catalogue into
`models_def/optics/glass/data/`; `misc.json` is edited by hand and
stays. Sumita is left out: its printed n_d and V_d disagree with its coefficients.

The second command writes the glasses that Schott's own catalogue file of December 2024 calls
obsolete, by its coefficients.

The third command writes the glasses that Schott made in 1983 and that neither of its catalogues
has, from table V of Robb and Mercado as the package `opticalglass` holds it (`opticalglass/data`).
Numbers of that transcription were misread here and there: a glass is taken only if a glass of
another table (today's equivalent, or another maker's of today or of table V) bears its index and
its dispersion out.
"""

import argparse
import json
import re
from pathlib import Path

import torch

from camkit.models_def.optics.glass.agf import read_agf
from camkit.models_def.optics.glass.catalogue import builtin_catalogues, trade_name_of
from camkit.models_def.optics.glass.dispersion import refractive_index
from camkit.models_def.optics.glass.encoding import read_text
from camkit.models_def.optics.glass.material import Glass

DATA = Path(__file__).resolve().parents[1] / "models_def" / "optics" / "glass" / "data"
MAKERS = {
    "Schott": "SCHOTT catalogue of 2017-01-20",
    "Ohara": "OHARA catalogue of 2017-11-30",
    "Hoya": "HOYA catalogue of 2017-04-01",
    "Hikari": "NIKON HIKARI catalogue of 2017-11",
    "CDGM": "CDGM catalogue of 2022-06",
}
ORGANIC = "organic/"
PLASTIC = "other/commercial plastics/"
POLYMERS = "Sultanova, Kasarova, Nikolov 2009, Acta Phys. Pol. A 116, 585"
LITERATURE = {
    "PMMA-Sultanova2009": (f"{ORGANIC}(C5H8O2)n - poly(methyl methacrylate)/Sultanova", POLYMERS),
    "PC-Sultanova2009": (f"{ORGANIC}(C16H14O3)n - polycarbonate/Sultanova", POLYMERS),
    "PS-Sultanova2009": (f"{ORGANIC}(C8H8)n - polystyren/Sultanova", POLYMERS),
    "SAN-Sultanova2009": ("other/mixed organic/(C8H8)n-(C3H3N)m/Sultanova", POLYMERS),
    "cellulose-Sultanova2009": (f"{ORGANIC}(C6H10O5)n - cellulose/Sultanova", POLYMERS),
    "NAS-21-Sultanova2009": (f"{PLASTIC}NAS-21/Sultanova", POLYMERS),
    "Zeonex-E48R-Sultanova2009": (f"{PLASTIC}ZeonexE48R/Sultanova", POLYMERS),
    "Optorez-1330-Sultanova2009": (f"{PLASTIC}Optorez1330/Sultanova", POLYMERS),
    "PMMA-Beadie2015": (
        f"{ORGANIC}(C5H8O2)n - poly(methyl methacrylate)/Beadie",
        "Beadie, Brindza, Flynn, Rosenberg, Shirk 2015, Appl. Opt. 54, F139",
    ),
    "fused-silica-Malitson1965": ("main/SiO2/Malitson", "Malitson 1965, J. Opt. Soc. Am. 55, 1205"),
    "CaF2-Malitson1963": ("main/CaF2/Malitson", "Malitson 1963, Appl. Opt. 2, 1103"),
    "CaF2-Daimon2002": ("main/CaF2/Daimon-20", "Daimon, Masumura 2002, Appl. Opt. 41, 5275"),
    "BaF2-Malitson1964": ("main/BaF2/Malitson", "Malitson 1964, J. Opt. Soc. Am. 54, 628"),
    "MgF2-o-Dodge1984": ("main/MgF2/Dodge-o", "Dodge 1984, Appl. Opt. 23, 1980"),
    "LiF-Li1976": ("main/LiF/Li", "Li 1976, J. Phys. Chem. Ref. Data 5, 329"),
    "sapphire-o-Malitson1972": (
        "main/Al2O3/Malitson-o",
        "Malitson, Dodge 1972, J. Opt. Soc. Am. 62, 1405A",
    ),
    "ZnSe-Connolly1979": (
        "main/ZnSe/Connolly",
        "Connolly, diBenedetto, Donadio 1979, Proc. SPIE 181, 141",
    ),
    "ZnS-Debenham1984": ("main/ZnS/Debenham", "Debenham 1984, Appl. Opt. 23, 2238"),
    "Ge-Burnett2016": ("main/Ge/Burnett", "Burnett, Kaplan, Stover, Phenis 2016, Proc. SPIE 9974"),
}
CLASSIC = "Schott1983"
CLASSIC_SOURCE = (
    "Robb, Mercado 1983, Appl. Opt. 22, 1198, table V: Schott catalogue, fit to 1e-4 or better"
)
CLASSIC_UM = (0.4, 0.7)
OBSOLETE = "SchottObsolete"
OBSOLETE_SOURCE = "SCHOTT catalogue file of December 2024, revision C, glasses marked obsolete"
OBSOLETE_STATUS = "2"
SAME_MELT = "HT"
"""At the end of a name: the same glass, clearer."""
WAVES_UM = torch.linspace(0.42, 0.68, 14, dtype=torch.float64)
THE_SAME = 2e-5
BASE_UM = 0.574
BORNE_OUT_INDEX, BORNE_OUT_DISPERSION = 1e-3, 5e-5
SCHOTT_POWERS = [0.0, 2.0, -2.0, -4.0, -6.0, -8.0]


def field(text: str, key: str) -> list[float]:
    """Return the numbers that stand behind a key of a database file; none if it is not there."""
    match = re.search(rf"^\s*-?\s*{key}: *([-+0-9.eE ]+)$", text, re.MULTILINE)
    return [float(word) for word in match[1].split()] if match else []


def dispersion(text: str) -> tuple[str, list[float]] | None:
    """Return formula and coefficients in camkit's terms; None for tables and rare formulas."""
    kind = re.search(r"type: formula (\d)", text)
    numbers = field(text, "coefficients")
    if kind is None or not numbers:
        return None
    if kind[1] in "12":
        power = 2 if kind[1] == "1" else 1
        pairs = zip(numbers[1::2], numbers[2::2], strict=True)
        terms = [v for b, c in pairs if b for v in (b, c**power)]
        return (
            ("sellmeier", terms) if numbers[0] == 0 else ("sellmeier_offset", numbers[:1] + terms)
        )
    if kind[1] not in "35":
        return None
    amounts, powers = [numbers[0], *numbers[1::2]], [0.0, *numbers[2::2]]
    if kind[1] == "5":
        cauchy_powers = [-2.0 * i for i in range(len(powers))]
        return ("cauchy", amounts) if powers == cauchy_powers else None
    if powers == SCHOTT_POWERS[: len(powers)]:
        return "schott", amounts + [0.0] * (6 - len(amounts))
    return "powers", [v for pair in zip(amounts, powers, strict=True) for v in pair if pair[0]]


def entry(path: Path, name: str, source: str = "") -> str | None:
    """Return a glass as a line of JSON; None where its formula is none of ours."""
    text = path.read_text(encoding="utf-8")
    formula = dispersion(text)
    if formula is None or "n_is_absolute: true" in text:
        return None
    row = [name, formula[0], field(text, "wavelength_range"), *printed_numbers(text), formula[1]]
    return json.dumps([*row, source] if source else row, separators=(",", ":"))


def printed_numbers(text: str) -> list[float | None]:
    """Return the printed n_d and V_d, where they are stated."""
    return [next(iter(field(text, key)), None) for key in ("nd", "Vd")]


def write(name: str, rows: list[str], source: str, *, literature: bool = False) -> None:
    """Write a catalogue."""
    head = {"catalogue": name, "literature": literature, "source": source}
    lines = ",\n".join(rows)
    text = f'{json.dumps(head)[:-1]},\n"glasses": [\n{lines}\n]}}\n'
    path = DATA / f"{name.lower()}.json"
    path.write_text(text, encoding="utf-8")
    print(f"{path.name}: {len(rows)} glasses, {len(text) / 1000:.0f} kB")


def classic_rows(text: str) -> list[str]:
    """Return glasses of 1983 that today's catalogue lacks, by the best numbers there are for each.

    Today's successor N-X has the very dispersion of X more often than not: then X has its
    coefficients. That is so if table V, or what another maker sells as X, says so.
    """
    own_section, *sections = text.split("#---")
    listed = {glass.name: glass for glass in classic_glasses(own_section)}
    catalogues = {c.name: c for c in builtin_catalogues() if not c.literature and c.name != CLASSIC}
    today = catalogues.pop("Schott")
    obsolete = catalogues[OBSOLETE]
    glasses = [g for c in (today, *catalogues.values()) for g in c.glasses if holds(g)]
    glasses += [glass for other in sections for glass in classic_glasses(other)]
    curves = torch.stack([refractive_index(glass, WAVES_UM) for glass in glasses])
    successors = [trade_name_of(g).removeprefix("N-") for g in today.glasses]
    rows = []
    for name in sorted({*listed, *successors}):
        if today.with_trade_name(name) or obsolete.with_trade_name(name):
            continue
        curves_of_name = []
        if name in listed:
            curves_of_name.append(refractive_index(listed[name], WAVES_UM))
        others = [g for c in catalogues.values() for g in c.with_trade_name(name) if holds(g)]
        curves_of_name += [refractive_index(g, WAVES_UM) for g in others]
        for successor in today.with_trade_name(f"N-{name}"):
            curve_of_successor = refractive_index(successor, WAVES_UM)
            if any(
                float((curve_of_successor - curve).abs().max()) <= THE_SAME
                for curve in curves_of_name
            ):
                facts = [successor.formula, successor.range_um, None, None, successor.coefficients]
                source = f"{CLASSIC_SOURCE}: as N-{name}, whose coefficients these are"
                rows.append(json.dumps([name, *facts, source], separators=(",", ":")))
                break
        else:
            if name in listed and borne_out(curves - curves_of_name[0]):
                row = [name, "buchdahl", CLASSIC_UM, None, None, listed[name].coefficients]
                rows.append(json.dumps(row, separators=(",", ":")))
            elif name in listed:
                print(f"{name}: not borne out, left out")
    return rows


def classic_glasses(section: str) -> list[Glass]:
    """Return the glasses of one maker in table V: name, base index and two Buchdahl terms."""
    lines = (line.split() for line in section.splitlines() if line.strip("-"))
    return [
        Glass(
            name=name,
            formula="buchdahl",
            coefficients=(*map(float, numbers[:3]), BASE_UM),
            source="table V",
        )
        for name, *numbers in lines
        if not name.startswith("#")
    ]


def obsolete_rows(path: Path) -> list[str]:
    """Return the glasses of Schott's file that it calls obsolete and camkit has not yet."""
    lines = [line.split() for line in read_text(path).splitlines() if line.startswith("NM ")]
    obsolete = {line[1] for line in lines if line[7:8] == [OBSOLETE_STATUS]}
    catalogues = [c for c in builtin_catalogues() if c.name in ("Schott", CLASSIC)]
    rows = []
    for glass in sorted(read_agf(path).glasses, key=lambda g: g.name):
        name = trade_name_of(glass)
        is_known = any(c.with_trade_name(name) for c in catalogues)
        if name not in obsolete or is_known or name.endswith(SAME_MELT):
            continue
        printed = [glass.stated_index_d, glass.stated_abbe_number]
        facts = [name, glass.formula, glass.range_um, *printed, glass.coefficients]
        rows.append(json.dumps(facts, separators=(",", ":")))
    return rows


def holds(glass: Glass) -> bool:
    """Return whether a glass is known over all wavelengths that are compared."""
    low_um, high_um = glass.range_um
    return low_um <= float(WAVES_UM[0]) and high_um >= float(WAVES_UM[-1])


def borne_out(differences: torch.Tensor) -> bool:
    """Return whether any of the curves has this index and dispersion."""
    shift = differences.mean(1, keepdim=True)
    bent = (differences - shift).abs().amax(1)
    return bool(((shift[:, 0].abs() <= BORNE_OUT_INDEX) & (bent <= BORNE_OUT_DISPERSION)).any())


def main() -> None:
    """Write the catalogues that were asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("database", type=Path, nargs="?")
    parser.add_argument("--classic", type=Path, help="table V, in the package opticalglass")
    parser.add_argument("--obsolete", type=Path, help="Schott's catalogue file with old glasses")
    arguments = parser.parse_args()
    if arguments.obsolete:
        write(OBSOLETE, obsolete_rows(arguments.obsolete), OBSOLETE_SOURCE)
    if arguments.classic:
        write(CLASSIC, classic_rows(arguments.classic.read_text("utf-8")), CLASSIC_SOURCE)
    if arguments.database:
        rewrite(arguments.database)


def rewrite(database: Path) -> None:
    """Write the makers' catalogues and that of the literature."""
    for maker, source in MAKERS.items():
        paths = sorted((database / "glass" / maker.lower()).rglob("*.yml"), key=lambda p: p.stem)
        rows = [row for path in paths if (row := entry(path, path.stem))]
        write(maker, rows, source)
    rows = [
        row
        for name, (path, source) in LITERATURE.items()
        if (row := entry(database / f"{path}.yml", name, source))
    ]
    write("literature", rows, "refractiveindex.info database", literature=True)


if __name__ == "__main__":
    main()
