"""A bracket of a small light to a frozen PSF.

    frames less darks -> merged light -> the light found -> each colour on its own lattice, centred
    to a fraction of a pixel -> background off -> a disc taken out, if it was one -> cropped
    -> noise smoothed -> sum 1

The colours are written as wavelengths, blue, green and red in this order, at `WAVELENGTHS_UM`: a
camera with such optics takes them by a `channel_response` that is one at its own and zero at the
others.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.calibration.darks import Darks
from camkit.calibration.disc import (
    DiscCore,
    FloatLine,
    fit_disc,
    middle_of,
    with_disc,
    without_disc,
)
from camkit.calibration.lattice import FloatGrid, Lattice
from camkit.calibration.light import LightCore, find_light, fit_core
from camkit.calibration.measured import (
    COLOURS,
    WAVELENGTHS_UM,
    ColourFacts,
    MeasuredPsf,
    PsfOptions,
    Reblurred,
    RedSamples,
    core_share,
    frozen,
)
from camkit.calibration.patch import BORDER_PX, CHANNELS, RED, Patch, cells
from camkit.calibration.peak import Field, height_mm, peak_share
from camkit.calibration.trim import cropped, reach_px, smooth_noise
from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError
from camkit.progress import working
from camkit.runtime.merging.merge import Merged, merge
from camkit.runtime.merging.survey import Survey

GREEN: Final = CHANNELS.index(1)
MOST_HALF_PX: Final = 511
CLIP_PX: Final = 8
LEAST_SPREADS: Final = 0.4
"""Standard deviation of a core, in pitches of its lattice, below which samples miss it: a Gaussian
then keeps a twentieth of its amplitude at the finest wave that the lattice holds."""
MOST_REST: Final = 0.15
SHOWN_PX: Final = 24
"""Beyond the rim of a disc, how far its picture is compared with the disc blurred anew."""
_EDGE_PX: Final = 3
_WHITE: Final = 0.98


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Centred:
    """All colours about the centre of green.

    Attributes:
        light: (colour, side, side), background taken off.
        noise: Its standard deviation.
        cores: Of each colour, in pixels of the patch.
    """

    light: FloatGrid
    noise: FloatGrid
    cores: list[LightCore]


@working("measuring the PSF of a light")
def measure_psf(survey: Survey, options: PsfOptions, darks: Darks | None) -> MeasuredPsf:
    """Measure the PSF of a bracket of a small light.

    Args:
        survey: The bracket; linear frames.
        options: What the caller says of it.
        darks: Taken off every frame; what is left is light, haze included.

    Raises:
        ContractError: If frames are coded, no pitch is known, or a side does not fit.
        DecodeError: If there is no light, it lies too near the border, its peak is clipped in the
            shortest frame, haze cannot be told from the background, or a disc is too large.
    """
    pitch_um = checked_pitch_um(survey, options)
    merged = merge(survey, None, None if darks is None else darks.rows)
    row, column = _place(merged, survey, options.disc_px)
    _refuse_clipped(merged, survey, (row, column), CLIP_PX + round((options.disc_px or 0) / 2))
    half = _most_half(survey, row, column, options.side_px)
    black_error = None if darks is None else darks.level_error(survey)
    patch = Patch(merged, survey, (row, column), half, black_error)
    centred = _centred(patch, half, options.disc_px)
    middle = centred.cores[GREEN]
    notes = _doubts(patch, centred.cores)
    light, noise = _as_point(centred, [lattice.pitch_px for lattice in patch.light]), centred.noise
    if options.side_px is None:
        side_px = reach_px(light, noise)
        if side_px == half:
            notes.append(f"light is still seen {half} px from the centre, where the crop ends")
        half = side_px
        light, noise = cropped(light, half), cropped(noise, half)
    kernels = np.stack([smooth_noise(p, n) for p, n in zip(light, noise, strict=True)])
    kernels = np.maximum(kernels, 0)
    kernels /= kernels.sum((-2, -1), keepdims=True)
    colours = _facts(kernels, light, noise, centred, patch)
    centre_px = (patch.left + middle.x, patch.top + middle.y)
    red = RedSamples(light=patch.red(half, middle), pitch_um=pitch_um * patch.light[RED].pitch_px)
    return MeasuredPsf(
        psf=frozen(kernels, pitch_um, options.depth_m),
        centre_px=centre_px,
        colours=colours,
        fields=(
            Field(
                height_mm=height_mm(survey.like, centre_px, pitch_um),
                peak_share=colours[GREEN].peak_share,
                peak_share_error=colours[GREEN].peak_share_error,
            ),
        ),
        notes=tuple(notes),
        filled_samples=patch.filled_samples(half, middle),
        red=red if options.disc_px is None else None,
    )


def checked_pitch_um(survey: Survey, options: PsfOptions) -> float:
    """Return the pixel pitch of frames that a PSF can be measured on.

    Raises:
        ContractError: If frames are coded, or no pitch is known.
    """
    pitch_um = options.pixel_pitch_um or survey.like.pixel_pitch_um
    if survey.codes is not None:
        raise ContractError("a PSF is measured on linear frames: RAW, EXR, 16-bit TIFF or PNG")
    if pitch_um is None:
        raise ContractError(f"the frames state no pixel pitch; add {option_text('pixel_pitch_um')}")
    return pitch_um


def _place(merged: Merged, survey: Survey, disc_px: float | None) -> tuple[int, int]:
    """Return (row, column) of the light, in pixels."""
    pitch, light = (2 if survey.like.cfa else 1), cells(merged, survey)
    place = find_light(light)
    if disc_px is not None:
        place = middle_of(light, place, disc_px / 2 / pitch)
    return place[0] * pitch, place[1] * pitch


def _refuse_clipped(merged: Merged, survey: Survey, place: tuple[int, int], reach: int) -> None:
    """Refuse a light that is clipped even in the shortest frame.

    Raises:
        DecodeError: If samples near it are clipped there.
    """
    row, column = place
    shortest, longest = survey.frames[-1], survey.frames[0]
    near = (
        slice(None),
        slice(max(0, row - reach), row + reach + 2),
        slice(max(0, column - reach), column + reach + 2),
    )
    white = _WHITE * longest.time_s / shortest.time_s
    clipped = np.count_nonzero((merged.precision[near] == 0) & (merged.light[near] >= white))
    if clipped:
        raise DecodeError(
            f"{clipped} samples of the light at ({column}, {row}) are clipped in the shortest "
            f"frame, {shortest.path.name}; add a shorter one"
        )


def _most_half(survey: Survey, row: int, column: int, side_px: int | None) -> int:
    """Return half the side that may be cropped around a place.

    Raises:
        ContractError: If the side that is asked for does not fit into the frame.
        DecodeError: If the light lies at the border.
    """
    like = survey.like
    most = min(row, column, like.height - 1 - row, like.width - 1 - column) - _EDGE_PX
    if most < BORDER_PX:
        raise DecodeError(
            f"the light lies at ({column}, {row}), at the border of {like.width}x{like.height} "
            "pixels; move it inwards"
        )
    if side_px is None:
        return min(most, MOST_HALF_PX)
    if side_px // 2 > most:
        raise ContractError(
            f"{option_text('side_px', side_px)} does not fit around the light at ({column}, {row}) "
            f"of {like.width}x{like.height} pixels; at most {2 * most + 1}"
        )
    return side_px // 2


def _centred(patch: Patch, half: int, disc_px: float | None) -> _Centred:
    """Return every colour on the pixels about the centre of green."""
    cores = [_core(lattice, patch.place, disc_px) for lattice in patch.light]
    middle = cores[GREEN]
    offset = np.arange(-half, half + 1, dtype=np.float64)
    y, x = np.meshgrid(middle.y + offset, middle.x + offset, indexing="ij")
    planes, noise = [], []
    for light, variance, core in zip(patch.light, patch.variance, cores, strict=True):
        rest = light.with_values(light.values - core.at(*light.places()))
        planes.append(rest.at(y, x) + core.at(y, x))
        noise.append(np.sqrt(np.maximum(variance.at(y, x, order=1), 1e-30)))
    return _Centred(light=np.stack(planes), noise=np.stack(noise), cores=cores)


def _core(lattice: Lattice, place: tuple[int, int], disc_px: float | None) -> LightCore:
    if disc_px is None:
        return fit_core(lattice, *place)
    return fit_disc(lattice, *place, disc_px)


def _as_point(centred: _Centred, pitches_px: Sequence[float]) -> FloatGrid:
    """Return (colour, side, side) light as of a point: discs are removed."""
    light, middle = centred.light.copy(), centred.cores[GREEN]
    for n, (core, pitch_px) in enumerate(zip(centred.cores, pitches_px, strict=True)):
        if isinstance(core, DiscCore):
            offset = core.y - middle.y, core.x - middle.x
            light[n] = without_disc(centred.light[n], centred.noise[n], core, offset, pitch_px)
    return light


def _doubts(patch: Patch, cores: Sequence[LightCore]) -> list[str]:
    """Return whether the core is too fine for the lattice of a colour."""
    for lattice, core in zip(patch.light, cores, strict=True):
        y, x = lattice.places()
        near = np.hypot(y - core.y, x - core.x) <= core.radius_px
        rest = np.abs(lattice.values - core.at(y, x))[near]
        narrow = core.spread_px < LEAST_SPREADS * lattice.pitch_px
        if lattice.pitch_px > 1 and (narrow or np.nanmax(rest) > MOST_REST * core.height):
            return [
                "the core is too fine for the mosaic: what lies between the samples of a colour "
                "is a guess; measure such optics on a sensor without a mosaic"
            ]
    return []


def _facts(
    kernels: FloatGrid, light: FloatGrid, noise: FloatGrid, centred: _Centred, patch: Patch
) -> tuple[ColourFacts, ...]:
    middle, facts = centred.cores[GREEN], []
    for n, (colour, wavelength_um) in enumerate(zip(COLOURS, WAVELENGTHS_UM, strict=True)):
        core, pitch_px = centred.cores[n], patch.light[n].pitch_px
        # what darks add to the noise is seen where there is no light
        modelled = float(np.nanmedian(patch.variance[n].values))
        variance = noise[n] ** 2 + max(0.0, patch.floors[n] ** 2 - modelled)
        share, error = peak_share(light[n], variance, patch.level_errors[n], pitch_px)
        facts.append(
            ColourFacts(
                colour=colour,
                wavelength_um=wavelength_um,
                core_share=core_share(kernels[n]),
                peak_share=share,
                peak_share_error=error,
                offset_px=(core.x - middle.x, core.y - middle.y),
                noise_floor=patch.floors[n] / core.height,
                reblurred=_reblurred(kernels[n] * light[n].sum(), centred.light[n], core),
            )
        )
    return tuple(facts)


def _reblurred(kernel: FloatGrid, image: FloatGrid, core: LightCore) -> Reblurred | None:
    """Return the means of rings of a disc, as captured and as a kernel predicts it."""
    if not isinstance(core, DiscCore):
        return None
    level = core.level
    offset = np.arange(kernel.shape[-1]) - kernel.shape[-1] // 2
    radius = np.hypot(offset[:, None], offset[None]).ravel()
    most = min(int(core.diameter_px / 2) + SHOWN_PX, kernel.shape[-1] // 2)
    ring = np.rint(radius).astype(np.intp)
    # as much light as of a point, spread over a disc of its level
    predicted = with_disc(kernel, core.diameter_px)
    counts = np.bincount(ring)[: most + 1]

    def means(values: FloatGrid) -> FloatLine:
        return np.asarray(np.bincount(ring, values.ravel())[: most + 1] / counts / level)

    at = np.bincount(ring, radius)[: most + 1] / counts
    return Reblurred(
        distance_px=at,
        captured=means(cropped(image, kernel.shape[-1] // 2)),
        predicted=means(predicted),
    )
