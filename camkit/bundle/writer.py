"""Writing a bundle: hashes filled in, read back, put in place by one rename.

The same content gives the same bytes: names sorted, time stamps fixed, one compressor setting.
"""

import hashlib
import io
import os
import stat
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from camkit.bundle.container import MAX_RATIO
from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.manifest import (
    Manifest,
    Member,
    format_of,
    manifest_to_bytes,
    manifest_without_networks,
)
from camkit.bundle.reader import MANIFEST, Bundle, bundle_from_bytes
from camkit.bundle.sensor import Sensor
from camkit.bundle.stages import Stage

_EPOCH: Final = (1980, 1, 1, 0, 0, 0)
_DEFLATE_LEVEL: Final = 9
_ZLIB_FRAME: Final = 6
"""Bytes that a stream of zlib has beside its deflated content."""


def bundle_to_bytes(manifest: Manifest, members: Mapping[str, bytes]) -> bytes:
    """Pack a bundle; the manifest's own list of members is replaced by what is given.

    Args:
        manifest: Everything but the members.
        members: Name -> content, without the manifest.
    """
    facts = {
        name: Member(sha256=hashlib.sha256(data).hexdigest(), size=len(data))
        for name, data in sorted(members.items())
    }
    full = manifest.model_copy(update={"members": facts})
    contents = {MANIFEST: manifest_to_bytes(full)} | dict(sorted(members.items()))
    stored: set[str] = set()
    while True:
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w") as archive:
            for name, data in contents.items():
                _write_member(archive, name, data, is_stored=name in stored)
        swollen = {info.filename for info in archive.infolist() if not _shrinks(info)} - stored
        if not swollen:
            return buffer.getvalue()
        stored |= swollen


def _write_member(archive: zipfile.ZipFile, name: str, data: bytes, *, is_stored: bool) -> None:
    info = zipfile.ZipInfo(name, _EPOCH)
    info.create_system = 3
    info.external_attr = (stat.S_IFREG | 0o644) << 16
    info.compress_type = zipfile.ZIP_STORED if is_stored else zipfile.ZIP_DEFLATED
    archive.writestr(info, data, compresslevel=_DEFLATE_LEVEL)


def _shrinks(info: zipfile.ZipInfo) -> bool:
    """Return whether a member is compressed, and no further than readers admit.

    Near-empty members (kernels with wide zero borders) would pass the ratio that readers refuse;
    those, and what does not shrink, are stored.
    """
    packed = info.compress_size + _ZLIB_FRAME
    return packed < info.file_size < MAX_RATIO * packed * 4 // 5


def write_bundle(path: Path, manifest: Manifest, members: Mapping[str, bytes]) -> Bundle:
    """Write a bundle and return it as a reader sees it.

    The file appears under its name complete or not at all.

    Args:
        path: The .camkit file, replaced if it is there.
        manifest: Everything but the members (its `members` are ignored).
        members: Name -> content, without the manifest.

    Raises:
        BundleError: If a reader would refuse the result; nothing is written then.
    """
    path = Path(path)
    data = bundle_to_bytes(manifest, members)
    bundle = bundle_from_bytes(data, path=path)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        Path(name).chmod(0o644)
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
    return bundle


def write_physics(
    path: Path,
    stages: tuple[Stage, ...],
    sensor: Sensor,
    optics: FrozenOptics,
    object_distance_mm: float,
    **facts: Any,
) -> Bundle:
    """Write a camera of physics alone: sensor, frozen optics, no network.

    Args:
        path: The .camkit file, replaced if it is there.
        stages: In order, none of them a network.
        sensor: What the camera sees with.
        optics: What it sees through.
        object_distance_mm: For which it is focused; inf for far away.
        facts: Other entries of the manifest, see `manifest_without_networks`; `version` and
            `licence` have defaults.

    Raises:
        BundleError: If the stages do not join, or a reader would refuse the result.
    """
    entry = optics.entry(object_distance_mm)
    manifest = manifest_without_networks(
        stages,
        sensor,
        entry,
        format_version=format_of(optics.psf, (*stages, entry)),
        **({"version": "0.1.0", "licence": "Apache-2.0"} | facts),
    )
    return write_bundle(path, manifest, optics.members)
