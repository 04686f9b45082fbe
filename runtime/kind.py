"""The runtime part of a kind of camera: readers, usual stages, products, and the twin.

A kind's part of the runtime (`camkit.runtime.kinds.NAME`, or the `runtime` of its own package)
defines `PART`, a `RuntimePart`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NoReturn, Protocol

from numpy.typing import NDArray

from camkit.bundle.manifest import Manifest
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import StageEntry
from camkit.errors import BundleError, ContractError, UnsupportedError
from camkit.kinds import BAYER, Kind, all_kinds, find_kind, kind_of_file
from camkit.runtime.array_capture import capture_of_array
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.job.choices import OF_CAPTURE
from camkit.runtime.job.job import Job
from camkit.runtime.job.kind_capture import KindCapture
from camkit.runtime.job.photograph import know_photograph
from camkit.runtime.job.setup import DEVELOPED, DEVELOPMENT
from camkit.runtime.kind_parts.golden import GoldenCaptures
from camkit.runtime.kind_parts.outputs import Outputs
from camkit.runtime.kind_parts.photograph_facts import describe_photograph
from camkit.runtime.kind_parts.picture_files import PICTURES
from camkit.runtime.options import Options
from camkit.runtime.raw import named_bundle

OF_PHOTOGRAPHS: Final = OF_CAPTURE | {"mosaic"}
"""What may be said of how a photograph was taken."""


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
        options: Options | None = None,
    ) -> Any:
        """Return the capture, a `KindCapture`."""
        ...


def _no_files(*_: object) -> NoReturn:
    raise UnsupportedError("captures of this kind are not read from files, or written")


def photograph_by_twin(scene: Any, bundle: Bundle, options: Any) -> Any:
    """Return what a camera for photographs records of a scene, by camkit's own twin."""
    # imported late: processing needs no twin
    from camkit.runtime.twin.simulate import photograph

    return photograph(scene, bundle, options)


def _itself(path: Path) -> tuple[Path, ...]:
    return (path,)


@dataclass(frozen=True, slots=True, kw_only=True)
class RuntimePart:
    """A kind of camera at use time; what a part leaves out is that of photographs.

    Attributes:
        read: (file, how to read a headerless mosaic, manifest or None, options) -> capture.
        from_array: An array as a capture.
        stages: What is done to a capture without a bundle.
        products: What comes out of that: name -> plane.
        know: Completes what is known of a capture before its stages are made ready, and plans.
        outputs: What captures become, in memory and as files.
        of_capture: What a caller may say of how a capture was taken: names of options, and of
            parameters of `Pipeline.run`.
        bundle_of: A capture's file -> the bundle that it names; None if it names none.
        describe: (a capture's file, how to read a headerless mosaic) -> what it is, as plain JSON
            values.
        simulate: (scene, bundle, its `simulation`) -> what the camera records; a scene is (3, h, w)
            linear Rec.709, or for some kinds the file of one.
        simulation: Type of the options of `simulate`; None for `SimulationOptions`.
        write: (file, what was recorded, bundle): writes a capture that `read` reads.
        suffixes: Of the files that `write` writes, with their dots; the usual one first.
        files: A capture's file -> all files that `write` writes for it, the capture first.
        golden: How golden captures of bundles are taken; None where procedural scenes are
            photographed.
        laws: Name of the module whose `LAWS` holds the laws of its pictures against a bundle.
    """

    read: Callable[[Path, MosaicOptions | None, Manifest | None, Options], KindCapture] = _no_files
    from_array: FromArray = capture_of_array
    stages: Sequence[StageEntry] = DEVELOPMENT
    products: Mapping[str, str] = field(default_factory=lambda: DEVELOPED)
    know: Callable[[Job], Job] = know_photograph
    outputs: Outputs = PICTURES
    of_capture: frozenset[str] = OF_PHOTOGRAPHS
    bundle_of: Callable[[Path], str | None] = named_bundle
    describe: Callable[[Path, MosaicOptions | None], Mapping[str, Any]] = describe_photograph
    simulate: Callable[[Any, Bundle, Any], Any] = photograph_by_twin
    simulation: type | None = None
    write: Callable[[Path, Any, Bundle], None] = _no_files
    suffixes: tuple[str, ...] = ()
    files: Callable[[Path], tuple[Path, ...]] = _itself
    golden: GoldenCaptures | None = None
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
