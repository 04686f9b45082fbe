"""The noise and the level of a block in a graph, and how they weigh its colours."""

from dataclasses import dataclass, replace

from camkit.runtime.bank.joint_colours import LEAST_MEASURED, LEAST_SHARE
from camkit.runtime.bank.wiener import LEAST_POWER
from camkit.runtime.portable.facts import CameraFacts
from camkit.runtime.portable.graph_builder import Value


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockNoise:
    """The noise of a block after white balance, and its level; (3,) each.

    Attributes:
        shot: Variance per light.
        read: Variance at black.
        level: Of the block.
        variance: Of its samples.
    """

    shot: Value
    read: Value
    level: Value
    variance: Value


def noise_of(
    facts: CameraFacts,
    tapered: Value,
    capture_noise: tuple[Value, Value, Value],
    rise: Value | None,
) -> BlockNoise:
    """Return noise and level of a (3, 4, n, n) block.

    Args:
        facts: Of the camera.
        tapered: The block.
        capture_noise: Shot noise, read variance and gains.
        rise: (3,) by which the variance was multiplied besides; None for nothing.
    """
    shot, read, gains = capture_noise
    least_shot, least_read = facts.least_noise
    shot, read = shot.at_least(least_shot) * gains, read.at_least(least_read) * (gains * gains)
    if rise is not None:
        shot, read = shot * rise, read * rise
    side = facts.shape.side
    mean = (tapered.sum(1, 2, 3) * (1 / side**2)).shaped(3).relu()
    level = (mean * mean).at_least(read).at_least(LEAST_POWER).sqrt()
    return BlockNoise(shot=shot, read=read, level=level, variance=shot * mean + read)


def shares(facts: CameraFacts, noise: BlockNoise) -> tuple[Value, Value, Value]:
    """Return a_c of every colour (3,), s (1,) and variance / (a^2 s) (3,), all for k = 1."""
    mean = noise.level.sum(0) * (1 / 3)
    share = (noise.level / mean).at_least(LEAST_SHARE)
    scale = mean * mean * facts.together.scale
    return share, scale, noise.variance / (share * share * scale)


def measured_light(light: Value, expected: Value, scale: Value) -> Value:
    """Return k, (1,), from the measured and the expected power of the light."""
    return (light / (expected * scale).at_least(1e-30)).at_least(LEAST_MEASURED)


def raised(noise: BlockNoise, least: Value) -> BlockNoise:
    """Return the noise with a variance of at least (3,)."""
    return replace(noise, variance=noise.variance.at_least(least))
