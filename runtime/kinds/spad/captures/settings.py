"""The caller's settings for a capture of single photons, with the timing file that they name."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal, get_args

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.runtime.kinds.spad.pooling import Pool
from camkit.runtime.kinds.spad.sharpen import METHODS, Method, Way
from camkit.runtime.kinds.spad.timing import Timing, read_timing, timing_beside
from camkit.runtime.options import DEFAULT_MAX_MEM_BYTES, Options
from camkit.side_file import read_side_bytes

Finer = Literal["net", "linear"]
FINER: Final[tuple[Finer, ...]] = get_args(Finer)
"""Ways to a finer grid, with a bundle."""
Product = Literal["depth", "intensity", "transient", "lifetime"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The product and the settings of its making.

    Attributes:
        product: None for what the capture is: depth of histograms, intensity of counts.
        way: How depth is fitted.
        depth_options: Options of depth alone that were chosen.
        finer: How pictures become finer behind a bundle's plate; None for what the plan says.
        size: Of its network; None for the usual one.
        timing: What is known of times.
        timing_file: Where that stands; None where nobody wrote it down.
        max_mem_bytes: Memory that the process may take.
    """

    product: Product | None
    way: Way
    depth_options: tuple[str, ...]
    timing: Timing
    max_mem_bytes: int
    timing_file: Path | None = None
    finer: Finer | None = None
    size: str | None = None

    @classmethod
    def of(cls, options: Options, capture: Path | None) -> "Settings":
        """Read what was chosen for a capture; None for one that is no file.

        Raises:
            ContractError: If the timing file is none.
        """
        file = _timing_file(options, capture)
        method: Method = next((m for m in METHODS if m == options.method), "log")
        pool: Pool = options.kind_choice("pool") or "auto"  # type: ignore[assignment]
        finer: Finer | None = next((way for way in FINER if way == options.method), None)
        depth_options = [
            name for name in ("pool", "returns") if options.kind_choice(name) is not None
        ]
        if options.method is not None and finer is None:
            depth_options.insert(0, "method")
        return cls(
            product=options.kind_choice("product"),  # type: ignore[arg-type]
            way=Way(method=method, pool=pool, returns=int(options.kind_choice("returns") or 1)),
            depth_options=tuple(depth_options),
            timing=Timing() if file is None else read_timing(file),
            max_mem_bytes=options.max_mem_bytes or DEFAULT_MAX_MEM_BYTES,
            timing_file=file,
            finer=finer,
            size=options.size,
        )

    def product_of(self, *, is_histogram: bool) -> Product:
        """Return what is to be made of a capture.

        Raises:
            ContractError: If it cannot be, or an option means nothing to it.
        """
        product = self.product or ("depth" if is_histogram else "intensity")
        if product != "intensity" and not is_histogram:
            raise ContractError(
                f"{product} needs the times of photons, and this capture holds counts alone; use "
                + option_text("product", "intensity")
            )
        if product != "depth" and self.depth_options:
            raise ContractError(
                f"{', '.join('--' + name for name in self.depth_options)} does not apply to the "
                f"product {product}: it is for depth; leave it out"
            )
        return product


def identity(options: Options, capture: Path) -> Mapping[str, Any]:
    """Return the content of a capture's timing file, and of the files that it names."""
    file = _timing_file(options, capture)
    if file is None:
        return {}
    files = [file, *read_timing(file).files]
    return {f"timing_{number}": _digest(one) for number, one in enumerate(files)}


def _digest(file: Path) -> str:
    """Return a hash of a file; an empty text where none lies."""
    if not file.is_file():
        return ""
    return hashlib.sha256(read_side_bytes(file, "the file")).hexdigest()


def _timing_file(options: Options, capture: Path | None) -> Path | None:
    """Return the timing file that was named, else that beside the capture, if one lies there."""
    name = options.kind_choice("timing")
    if name is not None:
        return Path(name)
    path = None if capture is None else timing_beside(capture)
    return path if path is not None and path.is_file() else None
