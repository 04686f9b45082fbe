"""Weights of wavelengths in lens files: a wavelength counts or not, and those that do are alike."""

from collections.abc import Mapping


def weighted_waves(
    weights: Mapping[float, float],
) -> tuple[tuple[float, ...], tuple[str, ...]]:
    """Return the wavelengths that count, increasing, and a note where their weights differ.

    A wavelength of weight 0 is not looked at, but may define the focus.

    Args:
        weights: By wavelength; without a weight other than 0 all count.
    """
    waves = tuple(sorted(wave for wave, weight in weights.items() if weight) or sorted(weights))
    shares = [weights[wave] for wave in waves]
    if len(set(shares)) == 1:
        return waves, ()
    listed = ", ".join(f"{weight:g}" for weight in shares)
    return waves, (f"wavelength weights {listed} left out: all wavelengths count alike",)
