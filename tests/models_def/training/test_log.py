import json
from pathlib import Path

import pytest

from camkit.errors import ContractError
from camkit.models_def.training.log import plot_logs, read_log, read_parts


def _log(path: Path, *entries: dict[str, float]) -> Path:
    path.write_text("".join(json.dumps(entry) + "\n" for entry in entries), encoding="utf-8")
    return path


def test_parts_are_counted_on(tmp_path: Path) -> None:
    first = _log(tmp_path / "a", {"step": 0, "cpu_s": 5.0, "wiener_db": 20.0}, {"step": 50, "cpu_s": 60.0, "loss": -1.0})  # noqa: E501 # fmt: skip
    second = _log(tmp_path / "b", {"step": 10, "cpu_s": 9.0, "seconds": 7.0, "valid_db": 21.0})
    assert read_parts([first]) == read_log(first)
    *_, last = read_parts([first, second, second])
    assert last == {"step": 70, "cpu_s": 78.0, "seconds": 14.0, "valid_db": 21.0}
    plot_logs({"one": first, "both": [first, second]}, tmp_path / "chart.png")
    assert (tmp_path / "chart.png").stat().st_size > 1000


@pytest.mark.parametrize("line", ["nothing", "[1]", '{"loss": 1}'])
def test_what_is_no_log_is_refused(tmp_path: Path, line: str) -> None:
    (tmp_path / "log").write_text(line, encoding="utf-8")
    with pytest.raises(ContractError, match="line 1"):
        read_log(tmp_path / "log")
