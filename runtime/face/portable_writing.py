"""`camkit.portable` and `camkit portable`: a camera as graphs, for programs without camkit."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from camkit.bundle.reader import find_bundle, open_bundle
from camkit.runtime.portable.package import write_portable
from camkit.units import MM_PER_M


def portable(
    bundle: str | Path,
    folder: str | Path,
    *,
    sizes: Sequence[str] | None = None,
    depth_m: float | None = None,
) -> Mapping[str, int]:
    """Write the chain of a camera as ONNX graphs, tables and a manifest; needs no torch.

    Args:
        bundle: Name of a built-in bundle, or a .camkit file.
        folder: New or empty, made if it does not exist; or a new file of the type .zip.
        sizes: Sizes of the network, such as ["S"]; None for all.
        depth_m: Object distance whose kernels the graphs take, where the bundle knows several; inf
            for infinity, None for their mean.

    Returns:
        Bytes of every file by its name. docs/guides/portable.md says what they hold.

    Raises:
        UnsupportedError: If a part of the chain has no graph; the message names it.
        ContractError: If the bundle has no such size or distance, or the folder holds something.
        BundleError: If the bundle is damaged.
    """
    opened = open_bundle(find_bundle(bundle))
    depth_mm = None if depth_m is None else depth_m * MM_PER_M
    size_names = None if sizes is None else tuple(sizes)
    return write_portable(opened, Path(folder), size_names, depth_mm=depth_mm)
