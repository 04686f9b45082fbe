"""Captures that become arrays, tables or films: files that are written once all of it is made."""

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from camkit.arrays import FloatArray
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.runtime.capture_result import Result
from camkit.runtime.job.reconstruction import Reconstruction
from camkit.runtime.kind_parts.outputs import FileSet, Outputs
from camkit.runtime.options import Options
from camkit.runtime.write_options import WriteOptions


def _stem(path: Path) -> str:
    return path.stem


def _no_identity(*_: object) -> Mapping[str, Any]:
    return {}


def product_outputs(
    make: Callable[[Reconstruction], Result],
    *,
    suffix: str,
    extra_suffixes: Callable[[Options], tuple[str, ...]],
    formats: Mapping[str, str],
    identity: Callable[[Options, Path], Mapping[str, Any]] = _no_identity,
    stem: Callable[[Path], str] = _stem,
) -> Outputs:
    """Return how captures become products that say who writes each of their files.

    Args:
        make: A capture on its way -> its products.
        suffix: Of the main file, with its dot.
        extra_suffixes: Options -> suffixes of the files that may appear beside it.
        formats: What may be asked for as a picture besides, each with its suffix.
        identity: See `Outputs`.
        stem: A capture's file -> the name of its products, without suffix.
    """

    def names(source: Path, options: Options, write: WriteOptions) -> tuple[str, ...]:
        if write.preview:
            raise ContractError(
                f"{option_text('preview')} is for photographs; {source.name} becomes products, "
                f"which have pictures as {option_text('format')}: leave it out"
            )
        if write.format is not None and write.format not in formats:
            raise ContractError(
                f"{option_text('format')} must be one of {', '.join(sorted(formats))} for "
                f"such captures; got {write.format}"
            )
        picture = () if write.format is None else (formats[write.format],)
        return tuple(stem(source) + end for end in (suffix, *extra_suffixes(options), *picture))

    def finish(
        work: Reconstruction, products: Sequence[str] | None, out: FloatArray | None
    ) -> Result:
        if out is not None:
            raise ContractError("out is filled with a picture; these captures become products")
        return _check_products(make(work), products)

    return Outputs(
        names=names,
        files=lambda work, write: _files(make(work), write),
        finish=finish,
        format=lambda write: write.format,
        identity=identity,
    )


def _files(product: Result, write: WriteOptions) -> FileSet:
    writers = product.files(write.format)

    def written(parts: Sequence[Path]) -> float:
        began = time.perf_counter()
        for part, write_to in zip(parts, writers.values(), strict=True):
            write_to(part)
        return time.perf_counter() - began

    return FileSet(suffixes=tuple(writers), write=written, result=lambda: product)


def _check_products(product: Result, products: Sequence[str] | None) -> Result:
    """Refuse products that a capture does not give.

    Raises:
        ContractError: Names those there are.
    """
    if foreign := [name for name in products or () if name not in product.arrays]:
        raise ContractError(
            f"there is no product {foreign[0]!r}; there are {', '.join(product.arrays)}"
        )
    return product
