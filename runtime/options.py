"""The caller's options of a reconstruction, checked once."""

import difflib
from collections.abc import Callable, Mapping, Set
from dataclasses import dataclass, fields, replace
from inspect import Parameter, signature
from operator import index
from os import PathLike
from pathlib import Path
from typing import Any, Final, Literal

from camkit.caller import option_list, option_text
from camkit.errors import ContractError
from camkit.field_types import check_fields, check_value
from camkit.kinds import Kind, KindOption, all_kinds
from camkit.runtime.capture import check_iso
from camkit.runtime.signal.halves import Halves, check_halves
from camkit.runtime.signal.tone_curve import Tone, read_tone
from camkit.runtime.unit import Unit, read_unit
from camkit.units import MM_PER_M

Mode = Literal["exact", "fast", "whole"]
Dtype = Literal["fp32", "fp16", "bf16"]
Provider = Literal["cpu", "cuda", "tensorrt", "openvino"]
OutputColor = Literal["rec709", "acescg", "camera"]
DemosaicMethod = Literal["fast", "quality"]
Assumption = Literal["centre", "scale"]
Quality = Literal["exact", "best", "adaptive", "draft"]
Scale = Literal["1", "1/2", "1/4"]
OnUnsafe = Literal["warn", "fallback", "fail"]
Laws = Literal["stated", "enforce"]
DEFAULT_MAX_MEM_BYTES: Final = 930_000_000
LEAST_MAX_MEM_BYTES: Final = 400_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """Everything that changes the pixels or the cost of a reconstruction.

    Attributes:
        size: Network size held by the bundle, such as S, M or L; None for that of the quality.
        quality: exact (M, nothing skipped), best (the largest size, nothing skipped), adaptive
            (no more than the capture needs) or draft; see camkit/runtime/plan.
        scale: Size of the picture over that of the capture, along each side: its mosaic is averaged
            over squares first, so that the price falls with the pixels.
        max_seconds: Time that a capture may take on this machine; None for any.
        max_error_db: Loss against `exact` that a capture may have at worst; None for that of the
            quality.
        depth_m: Object distance whose kernels the bank uses, where the bundle knows several (its
            PSF must reach it); None for the mean kernel over the depths.
        configuration: State of a zoom or focusing lens, by name or number from 1, where the bundle
            knows several; None for its first.
        method: Way of one of the bundle's stages: net (the network), a classical method alone, or
            develop (no restoration); None for the best that the bundle has.
        mode: Tiling: exact (bits of the whole picture), fast (smaller halo), whole (one window).
        demosaic: fast or quality; None for the method of the bundle, fast without one.
        color: Colour space of the result.
        white_balance: Gains (R, G, B), or None for the capture's own.
        exposure_ev: Factor 2**exposure_ev on the result.
        vignetting: Divide by the relative illumination.
        undistort: Undo the radial distortion.
        origin_px: (x, y) on the sensor of the first pixel of a crop; None for what
            the file records, else a whole frame.
        assume: What the caller vouches for where the capture's size does not match the sensor.
        force_bundle: Take the bundle also for captures that name another one.
        on_unsafe: What becomes of a capture outside the bundle's envelope, and of a tile whose
            output is not finite or not bounded: warn (a bad tile is an error), fallback (what
            came before the network, in capture or tile), fail (an error before work).
        laws: What holds the light of a network back: stated (the bound of the bundle, if it states
            one) or enforce (the usual bound where it states none).
        strength: How much of what a network adds to the picture in front of it is kept, 0..1.
        max_mem_bytes: Memory the process may take; None for the default of 0.93 GB.
        threads: Threads in all; None for those the process may use.
        tile_px: Output side of the windows, for tests and measurements; None lets the plan choose.
        tone: How the codes of developed pictures (JPEG, TIFF, PNG) become light; None for what
            their files and their bits state.
        halves: What differs in the paths of the two halves of dual pixels, as in ("_l", "_r");
            each capture is the left one, and the mean of both is processed. None for whole ones.
        noise: (shot, read variance) of linear light, white = 1, as sidecars state them; None for
            the file's, that of the ISO, or measured noise.
        iso: Sensitivity, for the noise that the bundle states; None for what the file states.
        unit: The camera body, whose facts the stages may use; None for any.
        dtype: Which graph of the bundle, fp32, or fp16 where it holds one (a CPU computes the
            latter in fp32 too, with weights rounded to fp16); or bf16, the graph of fp32
            multiplied in bfloat16, which openvino does where the processor has it.
        provider: What computes the network: onnxruntime on cpu, cuda or tensorrt, or openvino.
        of_kind: What is chosen for one kind of camera alone: (name, value), see `KindOption`.
    """

    size: str | None = None
    quality: Quality = "exact"
    scale: Scale = "1"
    max_seconds: float | None = None
    max_error_db: float | None = None
    depth_m: float | None = None
    configuration: str | int | None = None
    method: str | None = None
    mode: Mode = "exact"
    demosaic: DemosaicMethod | None = None
    color: OutputColor = "rec709"
    white_balance: tuple[float, float, float] | None = None
    exposure_ev: float = 0.0
    vignetting: bool = True
    undistort: bool = True
    origin_px: tuple[int, int] | None = None
    assume: Assumption | None = None
    force_bundle: bool = False
    on_unsafe: OnUnsafe = "warn"
    laws: Laws = "stated"
    strength: float = 1.0
    max_mem_bytes: int | None = None
    threads: int | None = None
    tile_px: int | None = None
    tone: Tone | None = None
    halves: Halves | None = None
    noise: tuple[float, float] | None = None
    iso: float | None = None
    unit: Unit | None = None
    dtype: Dtype = "fp32"
    provider: Provider = "cpu"
    of_kind: tuple[tuple[str, str], ...] = ()

    def __post_init__(self) -> None:
        check_fields(self)
        _check_of_kind(self.of_kind)
        for name, most in (("max_seconds", self.max_seconds), ("max_error_db", self.max_error_db)):
            if most is not None and not 0 < most < 1e6:
                raise ContractError(f"{option_text(name)} must be > 0; got {most}")
        if self.max_seconds is not None and self.quality != "exact":
            raise ContractError(
                f"{option_text('max_seconds')} finds the best quality that fits by itself; leave "
                f"{option_text('quality')} out"
            )
        _check_scale(self)
        _check_dtype(self.dtype, self.provider)
        _check_depth(self.depth_m)
        _check_noise(self.noise, self.iso)
        check_halves(self.halves)
        if not 0 <= self.strength <= 1:
            raise ContractError(f"strength must lie in 0..1; got {self.strength}")
        _check_origin(self.origin_px, self.assume)
        if self.white_balance is not None and not all(0 < g < 100 for g in self.white_balance):
            raise ContractError(f"white balance gains must lie in 0..100; got {self.white_balance}")
        if not -20 <= self.exposure_ev <= 20:
            raise ContractError(f"exposure must lie within -20..20 EV; got {self.exposure_ev}")
        if self.threads is not None and self.threads < 1:
            raise ContractError(f"threads must be >= 1; got {self.threads}")
        if self.tile_px is not None and self.tile_px < 1:
            raise ContractError(f"tiles have a side of at least 1 px; got {self.tile_px}")
        if self.max_mem_bytes is not None and self.max_mem_bytes < LEAST_MAX_MEM_BYTES:
            raise ContractError(
                f"the memory cap must be at least {LEAST_MAX_MEM_BYTES // 10**6} MB; "
                f"got {self.max_mem_bytes // 10**6} MB"
            )

    def kind_choice(self, name: str) -> str | None:
        """Return the caller's value of a kind's own option; None if there is none."""
        return dict(self.of_kind).get(name)

    @property
    def depth_mm(self) -> float | None:
        """Return the object distance as a PSF states it."""
        return None if self.depth_m is None else self.depth_m * MM_PER_M

    @property
    def focus_um(self) -> float:
        """Return the shift of the camera body's sensor from its nominal place; 0 without a body."""
        return 0.0 if self.unit is None else self.unit.focus_um


def kind_option(name: str) -> KindOption:
    """Return the option of a name that some kind of camera brings.

    Raises:
        ContractError: If no kind does.
    """
    for kind in all_kinds():
        for option in kind.options:
            if option.name == name:
                return option
    raise ContractError(f"no kind of camera has an option {name!r}")


def kind_option_names() -> list[str]:
    """Return the names of the options that kinds of cameras bring."""
    return sorted({option.name for kind in all_kinds() for option in kind.options})


def with_choices(
    options: Options, choices: Mapping[str, object], call: Callable[..., object] | None = None
) -> Options:
    """Return options with single ones chosen by name, those that a kind brings among them.

    A camera body may be given by its TOML file, a tone curve by its name or its file.

    Args:
        options: The others.
        choices: Name -> value.
        call: See `check_names`.

    Raises:
        ContractError: If one is unknown, or cannot be what it was given.
    """
    check_value("options", options, Options)
    kind_names = kind_option_names()
    check_names(choices, {*plain_names(), *kind_names}, call)
    plain = {name: value for name, value in choices.items() if name not in kind_names}
    if isinstance(body := plain.get("unit"), str | PathLike):
        plain["unit"] = read_unit(Path(body))
    if isinstance(curve := plain.get("tone"), str | PathLike):
        plain["tone"] = read_tone(curve)
    of_kind = dict(options.of_kind)
    of_kind |= {
        name: _text_of(name, choices[name]) for name in kind_names if choices.get(name) is not None
    }
    return replace(options, **{"of_kind": tuple(sorted(of_kind.items())), **plain})  # type: ignore[arg-type]


def plain_names() -> list[str]:
    """Return the names of the options of every camera."""
    return [name for name in Options.__dataclass_fields__ if name != "of_kind"]


def check_names(
    choices: Mapping[str, object], names: Set[str], call: Callable[..., object] | None = None
) -> None:
    """Refuse names that are no options.

    Args:
        choices: Name -> value.
        names: Of the options.
        call: What they were given to, whose other parameters are options too.

    Raises:
        ContractError: Names them, and near names or all there are.
    """
    if unknown := sorted(set(choices) - names):
        if call is not None:
            parameters = signature(call).parameters.values()
            names = names | {p.name for p in parameters if p.kind is not Parameter.VAR_KEYWORD}
        near = {n for name in unknown for n in difflib.get_close_matches(name, names, n=2)}
        hint = f"did you mean {' or '.join(sorted(near))}? " if near else ""
        raise ContractError(
            f"unknown option(s) {', '.join(unknown)}; {hint}known are {', '.join(sorted(names))}"
        )


def _text_of(name: str, value: object) -> str:
    """Return the caller's value of a kind's option as text."""
    hint = str | PathLike if kind_option(name).is_file else str | int
    check_value(name, value, hint)
    return f"{value}"


def _check_of_kind(of_kind: tuple[tuple[str, str], ...]) -> None:
    for name, text in of_kind:
        kind_option(name).check(text)


def with_absolute_files(options: Options) -> Options:
    """Return options whose files bear names that are true in every process."""
    of_kind = tuple(
        (name, str(Path(value).absolute()) if kind_option(name).is_file else value)
        for name, value in options.of_kind
    )
    return replace(options, of_kind=of_kind)


def given_options(options: Options) -> list[str]:
    """Return the options that differ from the defaults, those of kinds by their own names."""
    plain = Options()
    changed = [
        f.name for f in fields(Options) if getattr(options, f.name) != getattr(plain, f.name)
    ]
    return [name for name in changed if name != "of_kind"] + [name for name, _ in options.of_kind]


def check_kind_options(options: Options, kind: Kind, where: str) -> None:
    """Refuse options that another kind of camera brings.

    Args:
        options: What was chosen.
        kind: The kind in use.
        where: For people, such as "to bundle NAME".

    Raises:
        ContractError: Names them and the kind that they are for.
    """
    names = {option.name for option in kind.options}
    if foreign := [name for name, _ in options.of_kind if name not in names]:
        makers = [k for k in all_kinds() if any(o.name == foreign[0] for o in k.options)]
        raise ContractError(
            f"{option_list(foreign)} does not apply {where}: it is for cameras of the "
            f"kind {makers[0].name}; leave it out"
        )


def _check_scale(options: Options) -> None:
    if options.scale == "1":
        return
    foreign = [
        name
        for name in ("max_seconds", "max_error_db", "quality")
        if getattr(options, name) not in (None, "exact")
    ]
    if foreign:
        raise ContractError(
            f"{option_text('scale', options.scale)} decides what is done at its price; leave "
            f"{option_list(foreign)} out"
        )


def _check_dtype(dtype: Dtype, provider: Provider) -> None:
    if dtype == "bf16" and provider != "openvino":
        raise ContractError(
            f"{option_text('dtype', dtype)} is computed by openvino alone; add "
            f"{option_text('provider', 'openvino')}"
        )


def _check_depth(depth_m: float | None) -> None:
    if depth_m is not None and not depth_m > 0:
        raise ContractError(f"the depth must be > 0 m; got {depth_m}")


def _check_noise(noise: tuple[float, float] | None, iso: float | None) -> None:
    check_iso(iso)
    if noise is None:
        return
    if iso is not None:
        raise ContractError(
            f"{option_text('noise')} and {option_text('iso')} both say what the noise is: choose"
        )
    shot, read_variance = noise
    if not (0 < shot < 1 and 0 <= read_variance < 1):
        raise ContractError(
            f"{option_text('noise')} takes the shot noise and the read variance of linear light "
            "with white = 1, such as 5e-5,1e-8 (20,000 electrons at white, 2 of read noise); got "
            f"{shot:g},{read_variance:g}"
        )


def read_noise(text: str) -> tuple[float, float]:
    """Read the shot noise and the read variance of a text such as 5e-5,1e-8.

    Raises:
        ContractError: If it holds anything else.
    """
    try:
        shot, read_variance = (float(part) for part in text.split(","))
    except ValueError:
        raise ContractError(
            f"{option_text('noise')} takes two numbers SHOT,READ_VARIANCE; got {text!r}"
        ) from None
    return shot, read_variance


def checked_origin(origin_px: Any) -> tuple[int, int]:
    """Return a place on a sensor as two whole numbers.

    Raises:
        ContractError: If it is anything else.
    """
    try:
        x, y = (index(value) for value in origin_px)
    except (TypeError, ValueError):
        x = y = -1
    if min(x, y) < 0:
        raise ContractError(
            f"{option_text('origin_px')} must be two whole numbers (x, y) >= 0; got {origin_px!r}"
        )
    return x, y


def _check_origin(origin_px: tuple[int, int] | None, assume: str | None) -> None:
    if origin_px is not None and checked_origin(origin_px) and assume is not None:
        raise ContractError(
            f"{option_text('origin_px')} and {option_text('assume', assume)} both say where a "
            "capture lies: choose"
        )


def parse_memory(text: str) -> int:
    """Read a memory size such as 2G, 900M or 1.5GiB as bytes (G = 10^9, GiB = 2^30).

    Raises:
        ContractError: If the text is no size.
    """
    units = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9, "ki": 2**10, "mi": 2**20, "gi": 2**30}
    body = text.strip().lower().removesuffix("b")
    number = body.rstrip("kmgi")
    try:
        return int(float(number) * units[body[len(number) :]])
    except (ValueError, KeyError, OverflowError):
        raise ContractError(f"expected a memory size such as 2G or 900M; got {text!r}") from None
