"""tools/design_report.py: gains over the first lens, on the same captures."""

from tools.design_report import Row, table_of


def test_gains_are_paired_and_told_apart_by_iso_and_field() -> None:
    places = [(field, iso) for field in (0.0, 0.3, 0.55, 0.8, 0.98) for iso in (100.0, 1600.0)] * 2
    base = Row(name="first", every_db=[20.0 + i for i in range(20)], places=places)
    gains = [0.5 + (iso == 100.0) + field for field, iso in places]
    better = [a + b for a, b in zip(base.every_db, gains, strict=True)]
    other = Row(name="other", every_db=better, places=places)
    line = table_of([base, other], base).splitlines()[-1]
    cells = [cell.strip() for cell in line.strip("|").split("|")]
    assert cells[:5] == ["other", "31.03", "+1.53 +- 0.00", "+2.03", "+1.03"]
    assert cells[5:] == ["+1.00", "+1.30", "+1.55", "+1.80", "+1.98"]
