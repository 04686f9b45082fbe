"""The runtime part of a kind of camera: the reader of its captures, and its digital twin.

A kind's part of the runtime (`camkit.runtime.kinds.NAME`, or the `runtime` of its own package)
defines `PART`, a `RuntimePart`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, Protocol

from numpy.typing import NDArray

from camkit.bundle.manifest import Manifest
from camkit.bundle.reader import Bundle
from camkit.contracts import FloatArray
from camkit.errors import BundleError, ContractError, UnsupportedError
from camkit.kinds import BAYER, Kind, all_kinds, find_kind, kind_of_file
from camkit.runtime.array_capture import capture_of_array
from camkit.runtime.capture import Capture, MosaicOptions
from camkit.runtime.kind_parts.proving import Proving
from camkit.runtime.kind_parts.recording import Recording
from camkit.runtime.maker import Maker
from camkit.runtime.options import Options
from camkit.runtime.twin.simulate import Simulation, SimulationOptions, photograph


class FromArray(Protocol):
    """Gives an array in memory the meaning of a capture; see `capture_of_array`."""

    def __call__(
        self,
        image: NDArray[Any],
        manifest: Manifest,
        /,
        *,
        iso: float | None = None,
        white_balance: tuple[float, float, float] | None = None,
        origin_px: tuple[int, int] | None = None,
    ) -> Capture:
        """Return the capture."""
        ...


def _no_photograph(*_: object) -> NoReturn:
    raise UnsupportedError(
        "captures of this kind are no photographs; camkit.process and Pipeline.make make their "
        "products"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RuntimePart:
    """A kind of camera at use time: of photographs, or one that has a `maker` of its products.

    Attributes:
        read: (file, how to read a headerless mosaic, manifest or None) -> capture.
        write: (file, simulation, bundle): the capture as a file that `read` reads.
        suffix: Of the files that `write` writes, with its dot.
        from_array: An array as a capture.
        simulate: (scene (3, h, w) linear Rec.709, bundle, options) -> what the camera records.
        maker: What makes its products; None for photographs.
        proving: How its bundles prove themselves, where it has a maker.
        recording: How its captures are simulated, where it has a maker.
        laws: Name of the module whose `LAWS` holds the laws of its pictures against a bundle.
    """

    read: Callable[[Path, MosaicOptions | None, Manifest | None], Capture] = _no_photograph
    write: Callable[[Path, Simulation, Bundle], None] = _no_photograph
    suffix: str = ""
    from_array: FromArray = capture_of_array
    simulate: Callable[[FloatArray, Bundle, SimulationOptions], Simulation] = photograph
    maker: Maker | None = None
    proving: Proving | None = None
    recording: Recording | None = None
    laws: str = "camkit.runtime.proof.laws.photographs"


def runtime_part(kind: str) -> RuntimePart:
    """Return the runtime part of a kind.

    Raises:
        UnsupportedError: If there is no such kind, or the runtime knows nothing of it.
        ContractError: If its part defines no PART.
    """
    module = find_kind(kind).part("runtime")
    part = getattr(module, "PART", None)
    if not isinstance(part, RuntimePart):
        raise ContractError(f"{module.__name__} must define PART as a RuntimePart")
    return part


def part_of(manifest: Manifest) -> RuntimePart:
    """Return the runtime part of the kind of a bundle.

    Raises:
        BundleError: If that kind cannot be used here; says why.
    """
    try:
        return runtime_part(manifest.kind)
    except (UnsupportedError, ContractError) as error:
        raise BundleError(f"bundle {manifest.name} cannot be used here: {error}") from error


def kind_without_bundle(file: Path | None, options: Options) -> Kind:
    """Return the kind of a capture that comes without a bundle.

    It is the one whose options were chosen, else the one that alone has files of that type, else
    that of colour photographs.

    Raises:
        ContractError: If options of several kinds were chosen.
    """
    if options.of_kind:
        names = {name for name, _ in options.of_kind}
        fitting = [k for k in all_kinds() if names <= {option.name for option in k.options}]
        if not fitting:
            raise ContractError(
                f"no kind of camera has all options {', '.join(sorted(names))}; choose those of one"
            )
        return fitting[0]
    return (None if file is None else kind_of_file(file)) or BAYER
