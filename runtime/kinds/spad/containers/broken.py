"""Errors by which libraries tell of files that are damaged."""

import lzma
import struct
import zipfile
import zlib
from typing import Final

BROKEN: Final = (
    *(OSError, EOFError, ValueError, TypeError, LookupError, ArithmeticError, RuntimeError),
    *(struct.error, zlib.error, lzma.LZMAError, zipfile.BadZipFile),
    AssertionError,  # sdtfile, of a setup without its end, and tifffile
    UnboundLocalError,  # ptufile, where the first tag is damaged
)
"""Errors that any of them raises; readers add the errors that their own library brings."""
