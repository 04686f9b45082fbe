"""The exit codes of the process."""

from enum import IntEnum

from camkit.errors import BundleError, ContractError


class ExitCode(IntEnum):
    """Exit codes of every command."""

    DONE = 0
    INPUT_FAILED = 1
    USAGE = 2
    BUNDLE_REFUSED = 3
    NOTHING_MATCHED = 4
    INTERRUPTED = 130


def exit_code_of(error: Exception) -> ExitCode:
    """Return the exit code of an error that ended the whole command."""
    if isinstance(error, BundleError):
        return ExitCode.BUNDLE_REFUSED
    if isinstance(error, ContractError):
        return ExitCode.USAGE
    return ExitCode.INPUT_FAILED
