"""One capture made into products: every file and the sidecar appear together, or none does."""

from pathlib import Path

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.runtime.cancel import Cancel
from camkit.runtime.development import FileResult, WriteOptions, bundle_name, identity_of
from camkit.runtime.machine.memory import peak_rss_mb
from camkit.runtime.network.tiling import Progress
from camkit.runtime.output.part_file import atomic_outputs
from camkit.runtime.output.sidecar import sidecar_path, sidecar_text
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.raw import file_sha256


def make_file(
    source: Path,
    target: Path,
    pipeline: Pipeline,
    write: WriteOptions,
    *,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> FileResult:
    """Process one capture to its products and a sidecar; all appear or nothing changes.

    Args:
        source: The capture.
        target: The main file; the others have its name and suffixes of their own.
        pipeline: Of a kind that has a maker.
        write: Where and how to write.
        progress: Called with (work done, work in all).
        cancel: Asked between pieces of work; true raises `Cancelled`.

    Raises:
        DecodeError: If the capture cannot be read.
        ContractError: If capture and options do not fit, or a file is in the way.
        Cancelled: If `cancel` said so.
    """
    made = pipeline.make(source, progress=progress, cancel=cancel)
    files = made.files(write.format)
    paths = [target.with_suffix(suffix) for suffix in files]
    _check_free(source, paths, write)
    with atomic_outputs(sidecar_path(target), *paths) as (proof, *parts):
        for part, write_to in zip(parts, files.values(), strict=True):
            write_to(part)
        main, *beside = (file_sha256(part) for part in parts)
        result = FileResult(
            input=source,
            output=target,
            status="ok",
            bundle=bundle_name(pipeline),
            size=pipeline.size,
            seconds=made.seconds,
            peak_rss_mb=peak_rss_mb(),
            warnings=made.warnings,
            beside=tuple(paths[1:]),
        )
        record = {
            **result.to_json(),
            **identity_of(source, file_sha256(source), pipeline, write, None),
            "output_sha256": main,
            "beside_sha256": dict(zip(list(files)[1:], beside, strict=True)),
            "plan": dict(made.record),
            "clipped_fraction": None,
        }
        proof.write_text(sidecar_text(record, made.sections), encoding="utf-8")
    return result


def _check_free(source: Path, paths: list[Path], write: WriteOptions) -> None:
    """Refuse to replace the capture itself, or what nobody said may be replaced.

    Raises:
        ContractError: Names the file.
    """
    for path in paths:
        if path.resolve() == source.resolve():
            raise ContractError(
                f"{source} would overwrite itself; choose another {option_text('out_dir')}"
            )
        if path.exists() and not (write.overwrite or write.resume):
            raise ContractError(
                f"{path} exists; add {option_text('overwrite')}, or another "
                f"{option_text('out_dir')}"
            )
