"""The pipeline: a bundle and options made ready, then any number of captures.

    load(bundle) -> Pipeline -> run(file or array) -> Result: products by name
                             -> start(capture) -> Reconstruction: bands for a writer

A `Pipeline` is immutable and may serve many threads at once; each capture gets its own
`Reconstruction`.
"""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, closing
from dataclasses import replace
from os import PathLike
from pathlib import Path
from types import NoneType
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle, find_bundle, is_built_in, open_bundle
from camkit.bundle.stages import Wiener
from camkit.caller import option_list, option_text
from camkit.errors import BundleError, ContractError, UnsupportedError
from camkit.field_types import check_value
from camkit.kinds import Kind, find_kind
from camkit.runtime.cancel import Cancel, cancellable
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.capture_result import Result
from camkit.runtime.face.keywords import LoadKeywords
from camkit.runtime.files.in_memory import FilePath, Source, stored
from camkit.runtime.job.choices import check_choices
from camkit.runtime.job.reconstruction import Reconstruction, check_out
from camkit.runtime.job.setup import Setup
from camkit.runtime.job.stream import Stream
from camkit.runtime.kind import kind_without_bundle, part_of, runtime_part
from camkit.runtime.network.engine import NetworkEngine, available_threads
from camkit.runtime.network.tiling import Progress
from camkit.runtime.options import (
    DEFAULT_MAX_MEM_BYTES,
    Options,
    checked_origin,
    with_choices,
)
from camkit.runtime.plan.planner import asked_work, default_size
from camkit.runtime.plan.speed import Speed, measure_speed
from camkit.runtime.stage_finder import check_stages


class Pipeline:
    """A bundle with options, ready to reconstruct captures; safe to share between threads.

    Attributes:
        bundle: The camera; None develops only.
        options: What the caller chose.
        kind: The kind of camera whose captures it takes.
        part: What is known of that kind.
        threads: Threads to compute with.
        size: Size of network that is ready; None where none will run.
    """

    def __init__(self, bundle: Bundle | None, options: Options, kind: Kind | None = None) -> None:
        """Prepare the work that captures share.

        Args:
            bundle: The camera; None develops only.
            options: What the caller chose.
            kind: Without a bundle, the kind of camera; None for the one whose options were chosen,
                else colour photographs.

        Raises:
            BundleError: If the bundle is of a kind that is not installed, or asks too much of a
                machine.
            ContractError: If the bundle lacks what was asked for, or an option means nothing to it.
        """
        if bundle is not None and options.configuration is not None:
            bundle = bundle.with_configuration(options.configuration)
        self.bundle = bundle
        self.options = options
        self.threads = available_threads(options.threads)
        if bundle is not None:
            self.part = part_of(bundle.manifest)
            check_stages(bundle.manifest, options.max_mem_bytes or DEFAULT_MAX_MEM_BYTES)
            self.kind = find_kind(bundle.manifest.kind)
        else:
            self.kind = kind or kind_without_bundle(None, options)
            self.part = runtime_part(self.kind.name)
        check_choices(
            bundle,
            options,
            kind=self.kind,
            usual=self.part.stages,
            of_capture=self.part.of_capture,
        )
        self._lock = threading.Lock()
        self._engines: dict[tuple[str, str], NetworkEngine] = {}
        self._speeds: dict[tuple[str, str], float] = {}
        self._speed: Speed | None = None
        self.size: str | None = None
        if bundle is not None and asked_work(bundle, options).networks:
            self.size = default_size(bundle, options)
            for role in bundle.manifest.networks:
                self.network(role, self.size)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle what the pipeline was made from; the bundle is opened again by its hash."""
        bundle = self.bundle
        origin = None if bundle is None else (bundle.path, bundle.manifest.name, bundle.sha256)
        return _reopened, (origin, self.options, self.kind)

    def network(self, role: str, size: str) -> NetworkEngine:
        """Return the network of a role and size, made and proved when first asked for.

        Raises:
            ContractError: If there is no bundle, or it lacks the size.
            ParityError: If the provider does not compute the networks of the size as the bundle
                says; see `proof`.
        """
        engine = self._engine_for(role, size)
        self.proof(size)
        return engine

    def proof(self, size: str | None = None) -> Mapping[str, Any] | None:
        """Return what the provider has proved on this machine, as sidecars keep it.

        Whatever is not onnxruntime on the CPU computes the golden cases, a picture whole and in
        tiles, and the networks beside the CPU's, once a process, before it computes captures.

        Args:
            size: Of the networks; None for the size that is ready.

        Returns:
            Plain JSON values: `device`, `library`, `verdict`, `note` and every comparison;
            None on the CPU, and where no network will run.

        Raises:
            ParityError: If it does not compute what the bundle says.
        """
        size = size or self.size
        if self.bundle is None or self.options.provider == "cpu" or size is None:
            return None
        # imported late: the CPU proves nothing
        from camkit.runtime.device.device_proof import device_proof

        proof = device_proof(
            self.bundle, size, self._engine_for, self.options, threads=self.threads
        )
        return proof.to_json()

    def _engine_for(self, role: str, size: str) -> NetworkEngine:
        """Return the network of a role and size, made when first asked for."""
        if self.bundle is None:
            raise ContractError("without a bundle there is no network")
        with self._lock:
            if (role, size) not in self._engines:
                engine = _engine(self.bundle, (role, size), self.options, self.threads)
                self._engines[role, size] = engine
            return self._engines[role, size]

    def speed(self, sizes: Sequence[str]) -> Speed:
        """Return how fast this machine is; networks and bank are timed once per pipeline."""
        bundle = self.bundle
        roles = () if bundle is None else bundle.manifest.networks
        new = {
            (role, size): (self.network(role, size), bundle.network_facts(role, size))
            for role in roles
            for size in sizes
            if bundle is not None and (role, size) not in self._speeds
        }
        with self._lock:
            if self._speed is None or new:
                stage = None if bundle is None else bundle.manifest.stage(Wiener)
                measured = measure_speed(new, stage, threads=self.threads)
                self._speeds.update(measured.network_s_per_mp)
                self._speed = self._speed or measured
            return replace(self._speed, network_s_per_mp=dict(self._speeds))

    def read(
        self,
        file: Source,
        mosaic: MosaicOptions | None = None,
        *,
        origin_px: tuple[int, int] | None = None,
        cancel: Cancel | None = None,
    ) -> Any:
        """Read a capture of the bundle's kind of camera; to be closed by the caller.

        Args:
            file: A path, bytes, or a file opened in binary mode.
            mosaic: What the caller says of a mosaic in place of the file.
            origin_px: (x, y) of its first pixel on the sensor; None for the options', else the
                file's own.
            cancel: Asked ten times a second; true raises `Cancelled`.

        Raises:
            DecodeError: If the file cannot be read.
            Cancelled: If `cancel` said so.
            ContractError: If an argument is of another type, or a place is given and the sensor has
                no size.
        """
        check_value("mosaic", mosaic, MosaicOptions | None)
        manifest = None if self.bundle is None else self.bundle.manifest
        with cancellable(cancel), stored(file) as path:
            capture: Any = self.part.read(path, mosaic, manifest, self.options)
        origin = self.options.origin_px if origin_px is None else checked_origin(origin_px)
        if origin is None:
            return capture
        extent = None if manifest is None else manifest.sensor.extent
        if extent is None:
            raise ContractError(
                f"{option_text('origin_px')} is a place on a sensor; it needs a bundle that has one"
            )
        whole = (extent.width_px, extent.height_px)
        return replace(capture, origin_px=origin, sensor_size_px=whole)

    def start(
        self,
        capture: Any,
        *,
        progress: Progress | None = None,
        cancel: Cancel | None = None,
        known_planes: Mapping[str, Stream] | None = None,
        reserved_bytes: int = 0,
    ) -> Reconstruction:
        """Plan the reconstruction of one capture; its bands do the work.

        Args:
            capture: What the sensor gave.
            progress: Called with (work done, work in all), over all stages.
            cancel: Asked ten times a second; true raises `Cancelled`.
            known_planes: Planes of this capture that another reconstruction kept, by name.
            reserved_bytes: Of the memory cap, what the caller needs for what becomes of the bands.

        Raises:
            ContractError: If capture and bundle do not fit each other.
        """
        setup = Setup(
            bundle=self.bundle,
            options=self.options,
            networks=self.network,
            proof=self.proof,
            speed=self.speed,
            threads=self.threads,
            usual_stages=tuple(self.part.stages),
            usual_products=self.part.products,
        )
        return Reconstruction(
            setup,
            capture,
            know=self.part.know,
            progress=progress,
            cancel=cancel,
            ready_planes=known_planes,
            reserved_bytes=reserved_bytes,
        )

    def run(
        self,
        file: Source | NDArray[Any],
        *,
        products: Sequence[str] | None = None,
        mosaic: MosaicOptions | None = None,
        origin_px: tuple[int, int] | None = None,
        out: FloatArray | None = None,
        progress: Progress | None = None,
        cancel: Cancel | None = None,
    ) -> Result:
        """Make the products of one capture, of whatever kind.

        Args:
            file: A path, bytes, a file opened in binary mode; or an array as the bundle's sensor
                gives it: (h, w) mosaic in DN or (c, h, w) linear planes, see `process_array`.
            products: Names of products; None for the image of a photograph, or what the capture of
                another kind is for.
            mosaic: How to read a headerless mosaic, or levels in place of a RAW file's.
            origin_px: (x, y) of its first pixel on the sensor, for a crop that records none.
            out: (3, h, w) float32, linear, to fill with the first product; None for a new array.
            progress: Called with (work done, work in all), over all stages.
            cancel: Asked ten times a second; true raises `Cancelled`.

        Raises:
            DecodeError: If the file cannot be read.
            ContractError: If capture, options and bundle do not fit each other, or there is no such
                product.
        """
        check_out(out)
        began = time.perf_counter()
        with self._opened(file, mosaic, origin_px, cancel) as capture:
            decode_s = time.perf_counter() - began
            work = self.start(capture, progress=progress, cancel=cancel)
            result = self.part.outputs.finish(work, products, out)
        return replace(result, seconds={"decode": decode_s, **result.seconds})

    def process(
        self,
        file: Source,
        *,
        mosaic: MosaicOptions | None = None,
        origin_px: tuple[int, int] | None = None,
        out: FloatArray | None = None,
        progress: Progress | None = None,
        cancel: Cancel | None = None,
    ) -> Result:
        """Read one photograph and reconstruct it: `run`, whose result has an `image`.

        Args:
            file: A path, bytes, or a file opened in binary mode.
            mosaic: How to read a headerless mosaic, or levels in place of a RAW file's.
            origin_px: (x, y) of its first pixel on the sensor, for a crop that records none.
            out: (3, h, w) float32, linear, to fill with the picture; None for a new array.
            progress: Called with (work done, work in all), over all stages.
            cancel: Asked ten times a second; true raises `Cancelled`.

        Raises:
            DecodeError: If the file cannot be read.
            ContractError: If capture, options and bundle do not fit each other.
        """
        return self.run(
            file, mosaic=mosaic, origin_px=origin_px, out=out, progress=progress, cancel=cancel
        )

    def make(
        self,
        file: Source,
        *,
        progress: Progress | None = None,
        cancel: Cancel | None = None,
    ) -> Result:
        """Read one capture and make its products: `run`, whose result has `arrays`."""
        return self.run(file, progress=progress, cancel=cancel)

    def plan(
        self,
        file: Source | NDArray[Any],
        *,
        mosaic: MosaicOptions | None = None,
        origin_px: tuple[int, int] | None = None,
        cancel: Cancel | None = None,
    ) -> Mapping[str, Any]:
        """Return what `run` would do with a capture, without doing it.

        Args:
            file: A path, bytes, a file opened in binary mode, or an array as `process_array` takes:
                (h, w) mosaic in DN or (c, h, w) linear planes.
            mosaic: How to read a headerless mosaic, or levels in place of a RAW file's.
            origin_px: (x, y) of its first pixel on the sensor, for a crop that records none.
            cancel: Asked ten times a second; true raises `Cancelled`.

        Returns:
            Plain JSON values, as `camkit plan --json` prints them: `size` of the network or None,
            `decisions`, `estimate` (seconds and memory, or None), `plan` and `warnings`.

        Raises:
            DecodeError: If the file cannot be read.
            ContractError: If capture, options and bundle do not fit each other, or captures of
                this kind are no mosaics and have no place on a sensor.
        """
        with self._opened(file, mosaic, origin_px, cancel) as capture:
            return self.start(capture, cancel=cancel).planned()

    def _opened(
        self,
        file: Source | NDArray[Any],
        mosaic: MosaicOptions | None,
        origin_px: tuple[int, int] | None,
        cancel: Cancel | None,
    ) -> AbstractContextManager[Any]:
        """Return a capture that is closed at the end of a block.

        Raises:
            ContractError: If something is said that captures of this kind do not have.
        """
        facts = {"mosaic": mosaic, "origin_px": origin_px}
        names = [name for name, value in facts.items() if value is not None]
        if foreign := [name for name in names if name not in self.part.of_capture]:
            raise ContractError(
                f"{option_list(foreign)} does not apply to captures of the kind "
                f"{self.kind.name}; leave it out"
            )
        if not isinstance(file, np.ndarray):
            return closing(self.read(file, mosaic, origin_px=origin_px, cancel=cancel))
        check_value("mosaic", mosaic, NoneType)
        origin = self.options.origin_px if origin_px is None else origin_px
        return closing(self.capture_of(file, iso=None, white_balance=None, origin_px=origin))

    def stream(
        self,
        file: Source,
        on_band: Callable[[int, FloatArray], None],
        *,
        mosaic: MosaicOptions | None = None,
        origin_px: tuple[int, int] | None = None,
        progress: Progress | None = None,
        cancel: Cancel | None = None,
    ) -> Result:
        """Read one capture and hand its picture on, band by band, without holding it.

        Args:
            file: RAW, DNG, EXR, TIFF or PNG: a path, bytes, or a file opened in binary mode.
            on_band: Called with (first row, band (3, rows, w) float32, linear) from top to bottom.
            mosaic: How to read a headerless mosaic, or levels in place of a RAW file's.
            origin_px: (x, y) of its first pixel on the sensor, for a crop that records none.
            progress: Called with (work done, work in all), over all stages.
            cancel: Asked ten times a second; true raises `Cancelled`.

        Raises:
            DecodeError: If the file cannot be read.
            ContractError: If capture and bundle do not fit each other, or captures of this kind
                become products that have no rows to hand on.
        """
        summary = self.part.outputs.summary
        if summary is None:
            raise ContractError(
                f"captures of the kind {self.kind.name} become whole products, not bands of a "
                "picture: use `run`"
            )
        began = time.perf_counter()
        with self._opened(file, mosaic, origin_px, cancel) as capture:
            decode_s = time.perf_counter() - began
            work = self.start(capture, progress=progress, cancel=cancel)
            top = 0
            for band in work.bands():
                on_band(top, band)
                top += band.shape[1]
            result = summary(work)
        return replace(result, seconds={"decode": decode_s, **result.seconds})

    def process_array(
        self,
        image: NDArray[Any],
        *,
        iso: float | None = None,
        white_balance: tuple[float, float, float] | None = None,
        origin_px: tuple[int, int] | None = None,
        out: FloatArray | None = None,
        progress: Progress | None = None,
        cancel: Cancel | None = None,
    ) -> FloatArray:
        """Reconstruct a capture that is already in memory.

        Args:
            image: As the bundle's sensor gives it: (h, w) mosaic in DN, in its CFA and levels, or
                (c, h, w) linear planes with 1.0 = white level.
            iso: For the noise model; None measures the noise.
            white_balance: Gains (R, G, B); None takes those of the bundle's illuminant.
            origin_px: (x, y) of the first pixel on the sensor, for a crop; None for that of the
                options, else a whole frame. An odd one begins with another pixel of the CFA.
            out: (3, h, w) float32, linear, to fill; None for a new array.
            progress: Called with (work done, work in all), over all stages.
            cancel: Asked ten times a second; true raises `Cancelled`.

        Returns:
            (3, h, w) float32, linear, Rec.709 unless the options ask otherwise.

        Raises:
            ContractError: If shape, type or size do not fit the bundle.
        """
        check_out(out)
        if origin_px is None:
            origin_px = self.options.origin_px
        capture = self.capture_of(image, iso=iso, white_balance=white_balance, origin_px=origin_px)
        work = self.start(capture, progress=progress, cancel=cancel)
        return self.part.outputs.finish(work, None, out).image

    def capture_of(
        self,
        image: NDArray[Any],
        *,
        iso: float | None,
        white_balance: tuple[float, float, float] | None,
        origin_px: tuple[int, int] | None,
    ) -> Any:
        """Return an array with the meaning that the bundle's sensor gives it; see `process_array`.

        Args:
            image: (h, w) mosaic in DN, or (c, h, w) linear planes with 1.0 = white level.
            iso: For the noise model; None measures the noise.
            white_balance: Gains (R, G, B); None takes those of the bundle's illuminant.
            origin_px: (x, y) of the first pixel on the sensor; None as for `process_array`.

        Raises:
            ContractError: If shape, type or size do not fit the bundle.
        """
        if self.bundle is None:
            raise ContractError("an array needs a bundle: it says what the numbers mean")
        return self.part.from_array(
            image,
            self.bundle.manifest,
            iso=iso,
            white_balance=white_balance,
            origin_px=origin_px,
            options=self.options,
        )


def load(
    bundle: FilePath | None,
    *,
    kind: str | None = None,
    options: Options | None = None,
    **choices: Unpack[LoadKeywords],
) -> Pipeline:
    """Open a bundle and prepare it for captures.

    Args:
        bundle: Name of a built-in bundle, path of a bundle file, or None to develop only.
        kind: Without a bundle, the kind of camera, such as "spad"; None for the one whose options
            are chosen, else colour photographs.
        options: What changes the pixels.
        **choices: Single fields of `Options` by name, such as size="S", and the options of the
            kind, such as timing="t.toml".

    Raises:
        BundleError: If the bundle is refused.
        ContractError: If an option is unknown or of another type, the bundle lacks the size, or a
            kind is given beside a bundle.
        UnsupportedError: If there is no such kind.
    """
    check_value("bundle", bundle, str | PathLike | None)
    check_value("kind", kind, str | None)
    settings = with_choices(Options() if options is None else options, choices, load)
    if bundle is None or str(bundle).lower() == "none":
        return Pipeline(None, settings, None if kind is None else find_kind(kind))
    if kind is not None:
        raise ContractError("a bundle is of a kind of its own; leave kind out")
    return Pipeline(open_bundle(find_bundle(str(bundle))), settings)


def _reopened(origin: tuple[Path, str, str] | None, options: Options, kind: Kind) -> Pipeline:
    """Return the pipeline that was pickled.

    Raises:
        BundleError: If neither the path nor the name leads to the same bundle.
    """
    if origin is None:
        return Pipeline(None, options, kind)
    path, name, sha256 = origin
    bundle = open_bundle(path if path.is_file() else find_bundle(name))
    if bundle.sha256 != sha256:
        raise BundleError(
            f"{bundle.path} is not the bundle {name} that was pickled: its sha256 is "
            f"{bundle.sha256}, not {sha256}; give every process the same file"
        )
    return Pipeline(bundle, options)


def _engine(bundle: Bundle, key: tuple[str, str], options: Options, threads: int) -> NetworkEngine:
    (role, size), networks = key, bundle.manifest.networks
    if bundle.manifest.border != "edge":
        raise UnsupportedError(
            f"bundle {bundle.manifest.name} continues pictures by {bundle.manifest.border}; "
            "this runtime offers edge"
        )
    sizes = networks.get(role, {})
    if size not in sizes:
        raise ContractError(
            f"bundle {bundle.manifest.name} holds size(s) {', '.join(sorted(sizes))}; "
            f"asked for {size}; use {option_text('size', min(sizes))}"
            if sizes
            else f"bundle {bundle.manifest.name} holds no network; use method wiener"
        )
    data = bundle.network_bytes(role, size, fp16=options.dtype == "fp16")
    block_bytes = None
    if not is_built_in(bundle):  # theirs were checked when they were made, as the code was
        from camkit.runtime.network.graph import check_graph

        block_bytes = check_graph(data, sizes[size]).block_bytes_per_pixel
    return NetworkEngine(
        data,
        threads=threads,
        provider=options.provider,
        scale=sizes[size].output_scale,
        block_bytes=block_bytes,
        bfloat16=options.dtype == "bf16",
    )
