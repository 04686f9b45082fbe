"""A hostile bundle from a string of bytes: a sound one with faults on one or two levels.

zip        zip_faults      bytes of the container, local headers, directory
manifest   json_faults     values, keys, nesting
members    tensor_faults   headers, shapes and values of PSF and golden cases
networks   graph_faults    whatever an ONNX holds; often with facts that fit it
"""

import hashlib
import io
import json
import random
import zipfile
from typing import Any

from camkit.bundle.reader import MANIFEST
from camkit.errors import CamkitError
from camkit.runtime.network.graph import inspect_graph
from tests.hostile.bases import bases
from tests.hostile.decisions import Decisions
from tests.hostile.graph_faults import changed_model
from tests.hostile.json_faults import changed_json
from tests.hostile.tensor_faults import changed_file, changed_tensors
from tests.hostile.zip_faults import changed_bytes, changed_header

DECISION_BYTES = 512
_EPOCH = (1980, 1, 1, 0, 0, 0)


def seeded_decisions(seed: int) -> bytes:
    """Give the decisions of a numbered case."""
    return random.Random(seed).randbytes(DECISION_BYTES)


def sound_bundle(number: int) -> bytes:
    """Give a base as it is."""
    base = bases()[number]
    return _packed(json.dumps(base.manifest).encode(), base.members, deflate=True)


def hostile_bundle(decisions: bytes) -> bytes:
    """Give the bytes of a bundle that is, most likely, not sound."""
    choose = Decisions(decisions)
    base = choose.pick(bases())
    members, manifest = dict(base.members), json.loads(json.dumps(base.manifest))
    level = choose.pick(("zip", "header", *["json"] * 3, *["tensors"] * 2, "file", *["graph"] * 5))
    text = None
    if level == "graph":
        _change_network(manifest, members, choose)
    if level in ("tensors", "file"):
        names = [name for name in sorted(members) if name.endswith(".safetensors")]
        if names:
            name = choose.pick(names)
            change = changed_tensors if level == "tensors" else changed_file
            members[name] = change(members[name], choose)
    _hash_members(manifest, members)
    if level == "json" or choose.index(8) == 1:
        text = changed_json(manifest, choose)
    packed = _packed(text or json.dumps(manifest).encode(), members, deflate=choose.coin())
    if level == "zip":
        return changed_bytes(packed, choose)
    return changed_header(packed, choose) if level == "header" else packed


def _hash_members(manifest: dict[str, Any], members: dict[str, bytes]) -> None:
    manifest["members"] = {
        name: {"sha256": hashlib.sha256(data).hexdigest(), "size": len(data)}
        for name, data in sorted(members.items())
    }


def _change_network(manifest: dict[str, Any], members: dict[str, bytes], choose: Decisions) -> None:
    """Change a network; mostly its facts are made to fit, so that it gets past the first checks."""
    names = [name for name in sorted(members) if name.endswith(".onnx")]
    if not names:
        return
    name = choose.pick(names)
    members[name] = changed_model(members[name], choose)
    if not choose.index(4):
        return
    try:
        found = inspect_graph(members[name])
    except CamkitError:
        return
    for facts in _facts_of(manifest, name):
        facts |= {
            "receptive_field_radius_px": found.receptive_field_radius_px,
            "receptive_field_probe_px": 0,
            "stride_px": found.stride_px,
            "global_operators": list(found.global_operators),
            "mac_per_pixel": found.mac_per_pixel,
            "bytes_per_pixel": max(found.bytes_per_pixel, 1.0),
            "parameters": found.parameters,
            "max_activation": 1e30,
            "fp16_safe": False,
            "fp16_member": None,
        }


def _facts_of(manifest: dict[str, Any], member: str) -> list[dict[str, Any]]:
    """Give every entry of a manifest that names a network's member, whatever its format."""
    found, todo = [], [manifest.get("networks", {})]
    while todo:
        node = todo.pop()
        if node.get("member") == member:
            found.append(node)
        todo += [value for value in node.values() if isinstance(value, dict)]
    return found


def _packed(manifest: bytes, members: dict[str, bytes], *, deflate: bool) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in {MANIFEST: manifest, **members}.items():
            info = zipfile.ZipInfo(name, _EPOCH)
            shrinks = deflate and len(data) < 2**20
            info.compress_type = zipfile.ZIP_DEFLATED if shrinks else zipfile.ZIP_STORED
            archive.writestr(info, data)
    return buffer.getvalue()
