from pathlib import Path
from typing import Any

import pytest

from camkit.errors import ContractError
from camkit.runtime.output.sidecar import (
    MAX_BYTES,
    REQUIRED,
    read_sidecar,
    sidecar_path,
    sidecar_text,
)


def record(**changes: Any) -> dict[str, Any]:
    return dict.fromkeys(REQUIRED, 1) | {"seconds": {"decode": 0.5}} | changes


def test_sidecar_lies_beside_its_picture() -> None:
    assert sidecar_path(Path("out/a.b.exr")) == Path("out/a.b.camkit.json")


def test_record_comes_back(tmp_path: Path) -> None:
    output = tmp_path / "a.exr"
    sidecar_path(output).write_text(sidecar_text(record(camera="Größe")))
    found = read_sidecar(output)
    assert found is not None
    assert {k: v for k, v in found.items() if k != "sidecar_version"} == record(camera="Größe")
    assert [p.name for p in tmp_path.iterdir()] == ["a.camkit.json"]


@pytest.mark.parametrize("key", sorted(REQUIRED))
def test_record_without_a_required_key_is_refused(key: str) -> None:
    short = record()
    del short[key]
    with pytest.raises(ContractError, match=key):
        sidecar_text(short)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), Path("x"), {1, 2}])
def test_values_that_are_not_json_are_refused(value: object) -> None:
    with pytest.raises(ContractError, match="plain JSON"):
        sidecar_text(record(plan=value))


def test_sections_of_stages_stand_beside_the_plan_and_come_back(tmp_path: Path) -> None:
    output = tmp_path / "a.exr"
    sidecar_path(output).write_text(sidecar_text(record(), {"hdr": {"regions": 2}}))
    found = read_sidecar(output)
    assert found is not None
    assert found["hdr"] == {"regions": 2}
    assert {k: v for k, v in found.items() if k not in ("sidecar_version", "hdr")} == record()


@pytest.mark.parametrize("name", ["plan", "output_sha256", "sidecar_version"])
def test_a_section_never_takes_the_place_of_another_key(name: str) -> None:
    with pytest.raises(ContractError, match=f"name of its own; taken: {name}$"):
        sidecar_text(record(), {name: {"regions": 2}})


def test_a_section_that_is_not_json_is_refused() -> None:
    with pytest.raises(ContractError, match="plain JSON"):
        sidecar_text(record(), {"hdr": {"peak": float("nan")}})


@pytest.mark.parametrize(
    "content",
    [b"", b"{", b"[]", b"null", b"{}", b'{"sidecar_version": 1}', b"\xff\xfe", b"[" * 100_000],
)
def test_damaged_sidecar_proves_nothing(tmp_path: Path, content: bytes) -> None:
    output = tmp_path / "a.exr"
    sidecar_path(output).write_bytes(content)
    assert read_sidecar(output) is None


def test_missing_huge_or_newer_sidecar_proves_nothing(tmp_path: Path) -> None:
    output = tmp_path / "a.exr"
    assert read_sidecar(output) is None
    sidecar_path(output).write_bytes(b" " * (MAX_BYTES + 1))
    assert read_sidecar(output) is None
    sidecar_path(output).write_text(sidecar_text(record(sidecar_version=99)))
    assert read_sidecar(output) is None
