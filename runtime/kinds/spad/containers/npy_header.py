"""The header of an array in numpy's format."""

import io
import tokenize
import warnings
from typing import Any, Final

import numpy as np
from numpy.lib import format as npy

from camkit.errors import DecodeError
from camkit.runtime.kinds.spad.containers.broken import BROKEN

Header = tuple[tuple[int, ...], bool, np.dtype[Any]]
"""Shape, whether columns come first, type."""
BROKEN_HEADER: Final = (*BROKEN, SyntaxError, tokenize.TokenError, MemoryError)
"""Numpy parses headers as Python; one of many brackets takes more memory than the parser has."""


def read_header(start: io.BytesIO, what: str) -> Header:
    """Read shape, order and type of an array; what follows lies behind.

    Raises:
        DecodeError: If it is no header.
    """
    try:
        version = npy.read_magic(start)
        read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # headers of Python 2 are read as well
            return read(start)
    except BROKEN_HEADER as error:
        raise DecodeError(f"{what} is no array: its header is damaged") from error
