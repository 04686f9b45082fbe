"""`camkit.export.inspect_network` and `add_network`, for the command line too."""

import ast
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from camkit.bundle.reader import find_bundle, open_bundle
from camkit.caller import command_text, option_text
from camkit.entry_points import require_packages
from camkit.errors import ContractError
from camkit.export.foreign import adding, inspection
from camkit.export.foreign.contract import Contract, read_contract, to_contract
from camkit.export.foreign.inspection import Inspection
from camkit.export.foreign.onnx_file import ForeignModel, read_model
from camkit.field_types import checked
from camkit.models_def.face.torch_need import require_torch
from camkit.progress import working
from camkit.runtime.files.in_memory import FilePath
from camkit.runtime.output.part_file import refuse_existing


@checked
def inspect_network(
    network: FilePath,
    *,
    contract: FilePath | None = None,
    module: str | None = None,
    config: Mapping[str, Any] | None = None,
) -> Inspection:
    """Return everything in the way of a network at once, and what it costs.

    Args:
        network: ONNX, or a state dict of torch.
        contract: Contract (.toml) to compare it with; None looks at the network alone.
        module: Class of a state dict's network, "package:Class" (needs torch).
        config: Arguments of that class.

    Raises:
        DecodeError: If the file cannot be read.
        ContractError: If the contract has faults, or the state dict needs a module.
        BundleError: If it is no network of one picture.
    """
    terms = None if contract is None else read_contract(Path(contract))
    path = Path(network)
    model = _model(path, module, config or {}, "network inspect")
    with working(f"inspecting {path.name}"):
        return inspection.inspection_of(path.name, model, terms)


@checked
def add_network(
    network: FilePath,
    out: FilePath,
    *,
    contract: FilePath | Mapping[str, Any],
    camera: FilePath,
    pairs: FilePath | None = None,
    module: str | None = None,
    config: Mapping[str, Any] | None = None,
    name: str | None = None,
    version: str = "0.1.0",
    licence: str = "not stated",
    training_data: str = "not stated",
    overwrite: bool = False,
) -> dict[str, Any]:
    """Add a trained network to a copy of a camera's bundle and prove it.

    Args:
        network: ONNX, or a state dict of torch.
        out: Bundle to write (.camkit).
        contract: What it takes and gives: a file (.toml), or its tables.
        camera: Its bundle, name or path; its own networks are left out.
        pairs: Pairs of the owner's own script (.npz); None for those of the contract, if any.
        module: Class of a state dict's network, "package:Class" (needs torch).
        config: Arguments of that class.
        name: Of the new camera; None for that of the file.
        version: Semantic version of the bundle.
        licence: Of the weights.
        training_data: What they were trained on.
        overwrite: Whether a file that exists is replaced.

    Returns:
        What was shown, plain JSON values; `warnings` is a list.

    Raises:
        ContractError: If network, contract and camera do not go together; names all of it.
        UnsupportedError: If operators of the network cannot be taken; names all of them. If what
            draws the preview is not installed.
        ParityError: If a proof fails; nothing is written then.
    """
    refuse_existing([Path(out)], overwrite=overwrite)
    require_packages(f"{command_text('network add')} needs", "judge", ("matplotlib",))
    terms = _contract(contract)
    if pairs is not None:
        terms = replace(terms, pairs=Path(pairs))
    bundle = open_bundle(find_bundle(str(camera)))
    model = _model(Path(network), module, config or {}, "network add")
    label = adding.Label(name=name, version=version, licence=licence, training_data=training_data)
    return adding.bundle_with_network(model, terms, bundle, Path(out), label)


def to_config(words: Sequence[str]) -> dict[str, Any]:
    """Return arguments of a class from words KEY=VALUE; values are read as Python has them.

    Raises:
        ContractError: If a word has no key.
    """
    config = {}
    for word in words:
        key, equals, text = word.partition("=")
        if not equals or not key.isidentifier():
            raise ContractError(f"{option_text('config')} takes KEY=VALUE; got {word!r}")
        try:
            config[key] = ast.literal_eval(text)
        except (ValueError, SyntaxError):
            config[key] = text
    return config


def _contract(contract: FilePath | Mapping[str, Any]) -> Contract:
    if isinstance(contract, Mapping):
        return to_contract(dict(contract))
    return read_contract(Path(contract))


def _model(path: Path, module: str | None, config: Mapping[str, Any], command: str) -> ForeignModel:
    if path.suffix.lower() == ".onnx":
        if module is not None:
            raise ContractError(f"{option_text('module')} belongs to a state dict, not to an ONNX")
        return read_model(path)
    require_torch(command_text(command), "onnxscript")
    with working(f"loading torch for {path.name}"):
        from camkit.export.foreign.state_dict import model_of_state_dict

    return model_of_state_dict(path, module, config)
