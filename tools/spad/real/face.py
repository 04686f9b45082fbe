"""camkit as a user calls it: a file and a timing text become a product."""

import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import camkit
from camkit.runtime.options import Options, with_choices


@dataclass(frozen=True, slots=True, kw_only=True)
class Product:
    """What camkit made of a capture.

    Attributes:
        arrays: By name, as in NAME.npz.
        record: What was done.
        cpu_s: CPU seconds of it all, readers and bank included.
    """

    arrays: dict[str, NDArray[Any]]
    record: dict[str, Any]
    cpu_s: float


@contextmanager
def timing_file(text: str) -> Iterator[Path]:
    """Return a text as a file for --timing."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "timing.toml"
        path.write_text(text, encoding="utf-8")
        yield path


def product(file: Path, timing: str, **choices: object) -> Product:
    """Make the product of a file.

    Args:
        file: The capture.
        timing: What a file for --timing would hold.
        choices: Further options of `camkit.load`, such as pool, returns, product.
    """
    with timing_file(timing) as path:
        began = time.process_time()
        options = with_choices(Options(), {"timing": str(path), **choices})
        made = camkit.load(None, kind="spad", options=options).make(file)
        spent = time.process_time() - began
        arrays = {name: np.array(values) for name, values in made.arrays.items()}
        return Product(arrays=arrays, record=dict(made.record), cpu_s=spent)
