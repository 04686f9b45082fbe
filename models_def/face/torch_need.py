"""The check that torch is there, and what comes with it."""

from camkit.entry_points import require_packages


def require_torch(command: str, *others: str) -> None:
    """Raise an error that says how to install torch, if it is not there.

    Args:
        command: What needs it.
        others: Modules that it needs too, by their import names.

    Raises:
        UnsupportedError: If one cannot be imported.
    """
    require_packages(f"{command} needs", "train", ("torch", *others))
