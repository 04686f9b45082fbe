"""One capture made into files: read, reconstructed, written, and a sidecar with what was done."""

import json
import math
import time
from collections.abc import Mapping
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, Self

from camkit.caller import option_text
from camkit.errors import ContractError, one_line
from camkit.runtime.cancel import Cancel
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.job.reconstruction import Reconstruction
from camkit.runtime.machine.memory import peak_rss_mb
from camkit.runtime.network.tiling import Progress
from camkit.runtime.output.part_file import atomic_outputs
from camkit.runtime.output.sidecar import read_sidecar, sidecar_path, sidecar_text
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.raw import file_sha256
from camkit.runtime.signal.halves import right_half
from camkit.runtime.write_options import WriteOptions

Status = Literal["ok", "failed", "skipped"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FileResult:
    """The result of one input.

    Attributes:
        input: The capture.
        output: The picture, or the main file of products; None when it failed.
        status: ok, failed or skipped.
        error: Why it failed.
        bundle: Name of the bundle in use; None when only developed.
        size: Size of the network in use.
        seconds: Seconds per stage.
        peak_rss_mb: Peak memory of this process so far, its decoding child included.
        warnings: What the user should know.
        beside: Further files that were written, the sidecar left out.
        extent: Bins (or frames) and pixels of a capture of photons, in words; else empty.
    """

    input: Path
    output: Path | None
    status: Status
    error: str | None = None
    bundle: str | None = None
    size: str | None = None
    seconds: dict[str, float]
    peak_rss_mb: float
    warnings: tuple[str, ...] = ()
    beside: tuple[Path, ...] = ()
    extent: str = ""

    @classmethod
    def failure(cls, source: Path, bundle: str | None, error: str) -> Self:
        """Return the result of an input that failed."""
        return cls(
            input=source,
            output=None,
            status="failed",
            error=one_line(error),
            bundle=bundle,
            seconds={},
            peak_rss_mb=peak_rss_mb(),
        )

    @classmethod
    def skip(cls, source: Path, target: Path, pipeline: Pipeline, *warnings: str) -> Self:
        """Return the result of an input that was done before, or is done by another process."""
        return cls(
            input=source,
            output=target,
            status="skipped",
            bundle=bundle_name(pipeline),
            size=pipeline.size,
            seconds={},
            peak_rss_mb=peak_rss_mb(),
            warnings=warnings,
        )

    def to_json(self) -> dict[str, Any]:
        """Return the result as plain JSON values."""
        values = asdict(self)
        del values["extent"]  # the plan has its numbers
        return {
            **values,
            "input": str(self.input),
            "output": None if self.output is None else str(self.output),
            "seconds": {name: round(value, 4) for name, value in self.seconds.items()},
            "peak_rss_mb": round(self.peak_rss_mb, 1),
            "warnings": list(self.warnings),
            "beside": [str(path) for path in self.beside],
        }


def begin(
    pipeline: Pipeline,
    capture: Any,
    write: WriteOptions,
    *,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Reconstruction:
    """Plan a capture, the memory that its files take while they are written counted.

    Raises:
        ContractError: If capture and bundle do not fit each other, or the cap does not do.
    """
    reserved_bytes = pipeline.part.outputs.reserved_bytes(capture, write)
    return pipeline.start(capture, progress=progress, cancel=cancel, reserved_bytes=reserved_bytes)


def make_file(
    source: Path,
    target: Path,
    pipeline: Pipeline,
    write: WriteOptions,
    *,
    mosaic: MosaicOptions | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
    place: str = "out_dir",
) -> FileResult:
    """Process one capture to its files and a sidecar; either all appear or nothing changes.

    Args:
        source: The capture.
        target: The main file; the others have its name and suffixes of their own.
        pipeline: Of its camera.
        write: Where and how to write.
        mosaic: How to read a headerless mosaic.
        progress: Called with (work done, work in all).
        cancel: Asked ten times a second; true raises `Cancelled`.
        place: Name of the option by which the caller said where the files go.

    Raises:
        DecodeError: If the capture cannot be read.
        ContractError: If capture, bundle and options do not fit each other, or a file is in the
            way.
        Cancelled: If `cancel` said so.
    """
    began = time.perf_counter()
    outputs = pipeline.part.outputs
    with closing(pipeline.read(source, mosaic, cancel=cancel)) as capture:
        decode_s = time.perf_counter() - began
        # What both held while the child decoded; later this process grows, but the child is gone.
        decoded_mb = peak_rss_mb() + capture.decoder_peak_mb
        work = begin(pipeline, capture, write, progress=progress, cancel=cancel)
        # who asks for a time has had the machine timed; nobody else waits for it
        estimate = None if pipeline.options.max_seconds is None else work.explain()
        files = outputs.files(work, write)
        paths = [target.with_suffix(suffix) for suffix in files.suffixes]
        _check_free(source, paths, write, place)
        with atomic_outputs(sidecar_path(target), *paths) as (proof, *parts):
            write_s = files.write(parts)
            main, *extra_hashes = (file_sha256(part) for part in parts)
            product = files.result()
            seconds = {"decode": decode_s, **product.seconds, "write": write_s}
            result = FileResult(
                input=source,
                output=target,
                status="ok",
                bundle=bundle_name(pipeline),
                size=work.size,
                seconds=seconds,
                peak_rss_mb=max(peak_rss_mb(), decoded_mb),
                warnings=product.warnings,
                beside=tuple(paths[1:]),
                extent=_extent(work.record),
            )
            if estimate is not None:
                total_s = sum(seconds.values())
                work.record["estimate"] = estimate.compare(total_s, result.peak_rss_mb)
            input_sha256 = capture.sha256 or file_sha256(source)
            record = {
                **result.to_json(),
                **identity_of(source, input_sha256, pipeline, write, mosaic),
                "output_sha256": main,
                "beside_sha256": dict(zip(files.suffixes[1:], extra_hashes, strict=True)),
                "plan": dict(product.record),
                "clipped_fraction": work.clipped_fraction,
                **outputs.facts(work, write),
            }
            proof.write_text(sidecar_text(record, product.sections), encoding="utf-8")
    return result


def _extent(record: Mapping[str, Any]) -> str:
    """Return what was read of a capture with bins or frames; nothing of photographs."""
    if "bins" not in record:
        return ""
    count = record["bins"]
    name = "bins" if "time_bin_ps" in record else "frame" if count == 1 else "frames"
    return f"{count} {name}, {record['width']}x{record['height']} pixels"


def _check_free(source: Path, paths: list[Path], write: WriteOptions, place: str) -> None:
    """Refuse to replace the capture itself, or what nobody said may be replaced.

    Raises:
        ContractError: Names the file.
    """
    for path in paths:
        if path.resolve() == source.resolve():
            raise ContractError(
                f"{source} would overwrite itself; choose another {option_text(place)}"
            )
        if path.exists() and not (write.overwrite or write.resume):
            raise ContractError(
                f"{path} exists; add {option_text('overwrite', value=True)}, or another "
                f"{option_text(place)}"
            )


def proved_done(
    source: Path,
    target: Path,
    pipeline: Pipeline,
    write: WriteOptions,
    mosaic: MosaicOptions | None,
) -> bool:
    """Return whether a sidecar proves that exactly this work was done and its picture is whole."""
    if not (source.is_file() and target.is_file() and sidecar_path(target).is_file()):
        return False
    record = read_sidecar(target)
    identity = identity_of(source, file_sha256(source), pipeline, write, mosaic)
    if record is None or any(record.get(key) != value for key, value in identity.items()):
        return False
    if record.get("output_sha256") != file_sha256(target):
        return False
    return _are_whole(target, record.get("beside_sha256", {}))


def _are_whole(target: Path, hashes: Any) -> bool:
    """Return whether the files beside a main one are those of its sidecar."""
    if not isinstance(hashes, dict):
        return False
    extra_files = {target.with_suffix(str(suffix)): sha256 for suffix, sha256 in hashes.items()}
    return all(path.is_file() and file_sha256(path) == sha for path, sha in extra_files.items())


def identity_of(
    source: Path,
    input_sha256: str | None,
    pipeline: Pipeline,
    write: WriteOptions,
    mosaic: MosaicOptions | None,
) -> dict[str, Any]:
    """Return the values that decide the bytes of a picture or of products, as JSON values."""
    from camkit import __version__

    free = ("threads", "max_mem_bytes", "tile_px")
    options = pipeline.options
    settings = {k: v for k, v in asdict(options).items() if k not in free}
    if settings["depth_m"] == math.inf:
        settings["depth_m"] = "inf"  # JSON knows no infinity
    settings["unit"] = None if options.unit is None else asdict(options.unit)
    settings["tone"] = None if options.tone is None else options.tone.to_json()
    outputs = pipeline.part.outputs
    settings["format"] = outputs.format(write)
    settings["linear"] = write.linear
    settings |= {"jpeg_quality": write.quality if write.format == "jpeg" else None}
    settings |= {"strip_metadata": write.strip_metadata}
    settings |= {"preview": True} if write.preview else {}
    settings["mosaic"] = None if mosaic is None else asdict(mosaic)
    settings["of_kind"] = {
        **dict(options.of_kind),
        **outputs.identity(options, source),
    }
    identity = {
        "camkit": __version__,
        "input_sha256": input_sha256,
        "bundle_sha256": None if pipeline.bundle is None else pipeline.bundle.sha256,
        "options": settings,
    }
    if options.halves is not None:
        other = right_half(source, options.halves)
        identity["other_half"] = str(other)
        identity["other_half_sha256"] = file_sha256(other) if other.is_file() else None
    return dict(json.loads(json.dumps(identity)))


def bundle_name(pipeline: Pipeline) -> str | None:
    """Return the name of the bundle in use; None without one."""
    return None if pipeline.bundle is None else pipeline.bundle.manifest.name
