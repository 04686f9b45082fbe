"""The errors of camkit, one tree.

    CamkitError
    |-- ContractError (also ValueError)   the caller broke a promise: shape, range, option
    |-- DecodeError                       a capture or picture cannot be read
    |-- BundleError                       a bundle was refused
    |-- UnsupportedError                  understood, but not offered here
    `-- ParityError                       two computations that must agree do not

A message says what was expected, what came, and what to do.
"""


class CamkitError(Exception):
    """Every error that camkit raises on purpose."""


class ContractError(CamkitError, ValueError):
    """An argument breaks the stated contract (shape, range, unknown option)."""


class DecodeError(CamkitError):
    """A capture or picture file cannot be decoded, or its content is not believable."""


class BundleError(CamkitError):
    """A bundle was refused: damaged, hostile, too new, or contradicting itself."""


class UnsupportedError(CamkitError):
    """The request is understood but not offered here (missing extra, unknown variant)."""


class ParityError(CamkitError):
    """Two computations that must agree (torch and ONNX, tiled and whole) do not."""
