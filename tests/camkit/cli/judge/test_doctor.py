"""`camkit doctor`: facts about this machine, and a decoder that was tried."""

import json

from camkit.errors import DecodeError


def test_doctor_tells_versions_and_tries_the_decoder(camkit_command) -> None:
    outcome = camkit_command("doctor", "--json")
    facts = json.loads(outcome.out)
    assert outcome.code == 0
    assert facts["raw_decoder"] == "works"
    assert facts["threads"] >= 1
    assert facts["memory_mb"] > 100
    assert "CPUExecutionProvider" in facts["providers"]
    assert facts["packages"]["numpy"][0].isdigit()
    assert "bf16" in facts["openvino"]


def test_doctor_says_when_the_decoder_fails(camkit_command, monkeypatch) -> None:
    def broken(path: object) -> None:
        raise DecodeError("no LibRaw here")

    monkeypatch.setattr("camkit.runtime.raw.read_capture", broken)
    outcome = camkit_command("doctor")
    assert outcome.code == 0
    assert "raw_decoder: fails: no LibRaw here" in outcome.out
    assert "  numpy: " in outcome.out
