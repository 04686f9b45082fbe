"""For which bundles scenarios of single photons are meant."""

from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Sharpen, SuperResolve


def makes_finer(bundle: Bundle) -> str | None:
    """Return why a bundle cannot take scenarios of pictures; None if it can."""
    return None if bundle.manifest.stage(SuperResolve) else "it makes no picture of photons finer"


def has_times(bundle: Bundle) -> str | None:
    """Return why a bundle cannot take scenarios of depth; None if it can."""
    return makes_finer(bundle) if bundle.manifest.stage(Sharpen) else "it knows no times of photons"
