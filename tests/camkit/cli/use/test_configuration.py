"""`--configuration` of the commands that take a bundle with several states of a lens."""

import json
from pathlib import Path
from typing import Any

import pytest

from camkit.runtime.output.sidecar import sidecar_path
from tests.bundle_factory import write_tiny_bundle
from tests.states_bundle import write_states_bundle


def test_process_takes_a_state_and_says_which(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, camkit_command: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    write_states_bundle(tmp_path)
    bundle = ("--bundle", "zoom.camkit")
    state = ("--configuration", "long / near")
    shot = ("simulate", "procedural:3", "--size-px", "64,48", *bundle)
    assert camkit_command(*shot, "-o", "wide.dng").code == 0
    assert camkit_command(*shot, *state, "-o", "long.dng").code == 0
    assert Path("wide.dng").read_bytes() != Path("long.dng").read_bytes()

    def record(*options: str) -> dict[str, Any]:
        call = ("process", "long.dng", *bundle, "--out-dir", "out", "--overwrite", *options)
        outcome = camkit_command(*call)
        assert outcome.code == 0, outcome.err
        return dict(json.loads(sidecar_path(Path("out/long.exr")).read_text()), err=outcome.err)

    usual, near, second = record(), record(*state), record("--configuration", "2")
    assert (usual["plan"]["configuration"], usual["options"]["configuration"]) == ("wide", None)
    assert "2 configurations (wide, long / near): wide is taken; choose by" in usual["err"]
    assert near["plan"]["configuration"] == "long / near"
    assert "is taken" not in near["err"]
    assert usual["output_sha256"] != near["output_sha256"] == second["output_sha256"]
    told = camkit_command("info", "zoom.camkit", "--json").out
    assert json.loads(told)["psf"]["configurations"]["long / near"]["efl_mm"] == 70.0
    write_tiny_bundle(tmp_path)
    refused = camkit_command("process", "long.dng", "--bundle", "tiny.camkit", *state)
    assert "has one configuration" in refused.err
    assert (
        "does not apply without a bundle"
        in camkit_command("process", "long.dng", "--bundle", "none", *state).err
    )
