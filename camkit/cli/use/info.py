"""`camkit info`: what a bundle, a PSF, a capture or a sidecar is, or the manifest's schema."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from camkit.caller import command_text
from camkit.cli.choices import Debug, Json
from camkit.cli.say import say
from camkit.cli.use.mosaic import BlackLevel, MosaicCfa, WhiteLevel, mosaic_options
from camkit.errors import ContractError

if TYPE_CHECKING:
    from camkit.bundle.reader import Bundle

PSF_SUFFIX: Final = ".safetensors"
LONGEST: Final = 300
"""Characters of a value of a part of a list that are printed."""
ELSEWHERE: Final = {
    **dict.fromkeys((".zmx", ".json"), ("a lens", "lens show")),
    **dict.fromkeys((".onnx", ".pt", ".pth"), ("a network", "network inspect")),
}
"""Suffix of a file that another command describes -> what it is, the command."""


def info(
    file: Annotated[
        str | None,
        typer.Argument(
            help="Bundle (NAME or PATH), PSF (.safetensors), capture or sidecar to describe.",
            metavar="FILE",
        ),
    ] = None,
    schema: Annotated[
        bool, typer.Option("--schema", help="Print the JSON schema of the bundle manifest.")
    ] = False,
    mosaic: MosaicCfa = None,
    black_level: BlackLevel = None,
    white_level: WhiteLevel = None,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Print what a bundle, a PSF, a capture or a sidecar contains."""
    if schema:
        from camkit.bundle.manifest import manifest_schema

        say(json.dumps(manifest_schema(), indent=2))
        return
    if file is None:
        raise ContractError("give a bundle, a PSF, a capture or a sidecar, or --schema")

    from camkit.runtime.output.sidecar import SIDECAR_SUFFIX

    if file.endswith(SIDECAR_SUFFIX):
        _print_sidecar(Path(file), as_json=json_)
        return
    options = mosaic_options(mosaic, black_level, white_level)
    facts = _describe(file, options)
    if json_:
        say(json.dumps(facts))
        return
    if facts.get("laws"):
        facts["laws"] = _laws_text(facts["laws"])
    for line in _lines(facts, ""):
        say(line)


def _print_sidecar(path: Path, *, as_json: bool) -> None:
    from camkit.report.view.record_words import record_lines
    from camkit.report.view.result_search import read_record

    record = read_record(path)
    for line in [json.dumps(record)] if as_json else record_lines(record):
        say(line)


def _describe(file: str, mosaic: Any) -> dict[str, Any]:
    from camkit.bundle.reader import SUFFIX, built_in_bundles

    path = Path(file)
    if path.suffix == SUFFIX or (not path.exists() and file in built_in_bundles()):
        return _describe_bundle(file)
    if path.suffix.lower() == PSF_SUFFIX:
        return _describe_psf_file(path)
    if path.suffix.lower() in ELSEWHERE:
        what, command = ELSEWHERE[path.suffix.lower()]
        raise ContractError(
            f"{file} is {what} by its name; `{command_text(command)}` describes it. This command "
            "describes bundles, PSFs, captures and sidecars"
        )
    if not (path.exists() or path.suffix):
        from camkit.bundle.reader import find_bundle

        find_bundle(file)  # says which bundles there are
    return _describe_capture(path, mosaic)


def _describe_bundle(file: str) -> dict[str, Any]:
    from camkit.bundle.reader import find_bundle, open_bundle

    bundle = open_bundle(find_bundle(file))
    manifest = bundle.manifest.model_dump(mode="json", exclude={"members"}, exclude_none=True)
    for sizes in manifest["networks"].values():
        for facts in sizes.values():
            facts.pop("node_activation", None)
    return {
        "bundle": str(bundle.path),
        "sha256": bundle.sha256,
        "psf": _describe_psf(bundle),
        **manifest,
    }


def _describe_psf_file(path: Path) -> dict[str, Any]:
    from camkit.bundle.psf_file import (
        STATES,
        read_measurement,
        read_optics_bytes,
        read_source,
        read_tensors,
    )
    from camkit.bundle.states.state_tensors import states_from_tensors
    from camkit.calibration.psf_import.psf_facts import psf_facts, state_facts
    from camkit.runtime.raw import file_sha256

    facts = {"psf": str(path), "sha256": file_sha256(path)}
    data = read_optics_bytes(path, what="PSF")
    tensors = read_tensors(data, what=str(path))
    if STATES in tensors:
        states = states_from_tensors(tensors, what=str(path))
        return {**facts, "configurations": {s.name: state_facts(s) for s in states}}
    psf, uncertainty = read_measurement(path)
    return {**facts, **psf_facts(psf, uncertainty, read_source(data))}


def _laws_text(laws: dict[str, dict[str, Any]]) -> dict[str, dict[str, str]]:
    """Return each law as one line: its worst number, its limit, whether it is kept."""
    from camkit.bundle.facts import StatedLaw
    from camkit.runtime.proof.laws.law import number_text

    def line(law: StatedLaw) -> str:
        worst, limit = (number_text(value, law.unit) for value in (law.worst, law.limit))
        return f"{worst} (at most {limit}){'' if law.kept else ', BROKEN'}"

    return {
        size: {name: line(StatedLaw.model_validate(law)) for name, law in by_name.items()}
        for size, by_name in laws.items()
    }


def _describe_psf(bundle: "Bundle") -> dict[str, Any] | None:
    from camkit.bundle.optics import PSF
    from camkit.psf import depth_name

    if PSF not in bundle.names:
        return None
    if states := bundle.frozen_optics.states:
        from camkit.calibration.psf_import.psf_facts import state_facts

        return {"configurations": {state.name: state_facts(state) for state in states}}
    psf = bundle.psf
    focus = {} if psf.focus_um is None else {"focus_um": psf.focus_um.tolist()}
    return {
        "kernels": list(psf.kernels.shape),
        "field_heights_mm": [round(float(v), 3) for v in psf.field_heights_mm],
        "depths": [depth_name(v) for v in psf.depths_mm],
        "wavelengths_um": [round(float(v), 4) for v in psf.wavelengths_um],
        **focus,
    }


def _describe_capture(path: Path, mosaic: Any) -> dict[str, Any]:
    from camkit.kinds import BAYER, kind_of_file
    from camkit.runtime.kind import runtime_part
    from camkit.runtime.raw import file_sha256

    kind = kind_of_file(path)
    facts = runtime_part((kind or BAYER).name).describe(path, mosaic)
    kind_fact = {} if kind is None else {"kind": kind.name}
    return {"capture": str(path), "sha256": file_sha256(path), **kind_fact, **facts}


def _lines(value: Any, indent: str) -> list[str]:
    lines = []
    for key, item in value.items():
        if isinstance(item, dict) and item:
            lines += [f"{indent}{key}:", *_lines(item, indent + "  ")]
        elif isinstance(item, list) and item and isinstance(item[0], dict):
            lines.append(f"{indent}{key}:")
            lines += [
                f"{indent}  - " + ", ".join(f"{k} {_shortened(v)}" for k, v in part.items())
                for part in item
            ]
        elif item is not None:
            lines.append(f"{indent}{key}: {item}")
    return lines


def _shortened(value: Any) -> str:
    """Return a value as text, shortened if it fills lines; --json has it all."""
    text = str(value)
    if len(text) <= LONGEST:
        return text
    return f"{text[:LONGEST]} ... ({len(text) - LONGEST} characters more, see --json)"
