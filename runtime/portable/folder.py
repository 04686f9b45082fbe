"""Files of a portable camera in a folder or in a zip, all of them or none."""

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from camkit.errors import ContractError
from camkit.runtime.output.part_file import atomic_output, write_together

ZIP: Final = ".zip"


def check_target(out: Path) -> None:
    """Refuse a folder that holds something, or a zip that exists.

    Raises:
        ContractError: If it is so.
    """
    if out.suffix.lower() == ZIP:
        if out.exists():
            raise ContractError(f"{out} exists; choose another name")
    elif out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise ContractError(f"{out} must be empty or not exist")


def write_files(out: Path, files: Mapping[str, bytes]) -> None:
    """Write files into a folder, made if it does not exist, or into a new zip.

    The same files make the same zip.

    Raises:
        OSError: If one cannot be written; none is left then.
    """
    if out.suffix.lower() != ZIP:
        write_together({out / name: data for name, data in files.items()})
        return
    out.parent.mkdir(parents=True, exist_ok=True)
    with atomic_output(out) as part, zipfile.ZipFile(part, "w") as archive:
        for name, data in files.items():
            member = zipfile.ZipInfo(name)
            member.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(member, data)
