"""FILE, FOLDER or PATTERN to a stack of kernels.

A pattern names the place of a kernel in the name of its file:

    crops/psf_r{row}_c{col}.png          {row}, {col}  whole numbers, from any first one on
    lab/{c}_{i}.txt                      {i}           rows and columns in one, --grid beside it
                                         {c}           R, G, B, or a wavelength in nm or um
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from camkit.calibration.psf_import import array_files, kernel_pictures, zemax_listing
from camkit.calibration.psf_import.array_axes import ordered
from camkit.calibration.psf_import.array_files import read_array
from camkit.calibration.psf_import.kernel_pictures import read_kernels
from camkit.calibration.psf_import.kernel_stack import (
    WAVELENGTH_OF,
    FloatGrid,
    ImportOptions,
    KernelStack,
    refuse,
)
from camkit.calibration.psf_import.zemax_listing import Listing, read_listing
from camkit.caller import option_text
from camkit.entry_points import entry_points, load_entry_point
from camkit.errors import ContractError

READ: Final = (*array_files.SUFFIXES, *kernel_pictures.SUFFIXES, *zemax_listing.SUFFIXES)
GROUP: Final = "camkit.psf_readers"
"""Of entry points, by which packages bring readers of kernels: suffix without its dot -> a function
of a path that returns an array, whose axes the caller states as those of .npy."""
_PARTS: Final = {
    "{row}": r"(?P<row>\d+)",
    "{col}": r"(?P<col>\d+)",
    "{i}": r"(?P<i>\d+)",
    "{c}": r"(?P<c>[A-Za-z]|\d+(?:\.\d+)?)",
}
_USUAL: Final = re.compile(
    r".*?r(?:ow)?[_-]?(?P<row>\d+).*?c(?:ol(?:umn)?)?[_-]?(?P<col>\d+).*", re.I
)
_NM_FROM: Final = 10.0
_MOST_NAMES: Final = 6
_Place = tuple[int, int, str]


def read_source(source: str | Path, options: ImportOptions) -> KernelStack:
    """Read kernels from a file, a folder, or the files of a pattern.

    Raises:
        ContractError: If files are missing, or options and files contradict each other.
        DecodeError: If a file is damaged.
    """
    text, path = str(source), Path(source)
    if "{" in text and not path.exists():
        return _of_pattern(path, options)
    if path.is_dir():
        return _of_folder(path, options)
    if not path.is_file():
        raise ContractError(
            f"there is no {text}; give a file, a folder, or a pattern like "
            "crops/psf_r{row}_c{col}.png"
        )
    return _of_file(path, options)


def _of_file(path: Path, options: ImportOptions) -> KernelStack:
    suffix = path.suffix.lower()
    if suffix in zemax_listing.SUFFIXES:
        listing = read_listing(path)
        waves = None if listing.wavelength_um is None else (listing.wavelength_um,)
        return KernelStack(
            values=ordered(listing.values, options, path.name),
            pitch_um=listing.spacing_um,
            wavelengths_um=waves,
            middle_px=listing.middle_px,
        )
    if suffix in kernel_pictures.SUFFIXES:
        samples, notes = read_kernels(path)
        return KernelStack(values=ordered(samples, options, path.name), notes=notes)
    if suffix in array_files.SUFFIXES:
        array = read_array(path, options.variable)
        return KernelStack(values=ordered(array, options, path.name))
    if suffix == ".safetensors":
        raise ContractError(
            f"{path.name} is a PSF of camkit already: name it in a recipe ([lens] psf)"
        )
    point = entry_points(GROUP).get(suffix.removeprefix("."))
    if point is not None:
        reader = load_entry_point(point, "PSF reader")
        if not callable(reader):
            raise ContractError(f"the PSF reader {point.name!r} of {point.value} reads nothing")
        return KernelStack(values=ordered(np.asarray(reader(path)), options, path.name))
    suffixes = (*READ, *(f".{name}" for name in entry_points(GROUP)))
    raise ContractError(f"{path.name} is no file of kernels; expected {', '.join(suffixes)}")


def _of_folder(folder: Path, options: ImportOptions) -> KernelStack:
    files = sorted(file for file in folder.iterdir() if file.suffix.lower() in READ)
    if not files:
        raise ContractError(f"{folder} holds no file of kernels ({', '.join(READ)})")
    matches = {file: _USUAL.fullmatch(file.stem) for file in files}
    if all(matches.values()):
        return _of_places(
            {_place(match): file for file, match in matches.items() if match}, options
        )
    if all(file.suffix.lower() in zemax_listing.SUFFIXES for file in files):
        return _of_fields(files, options)
    names = _few([file.name for file, match in matches.items() if match is None])
    raise ContractError(
        f"{names} name no row and column; give a pattern in place of the folder, like "
        f"{folder}/psf_r{{row}}_c{{col}}.png"
    )


def _of_pattern(pattern: Path, options: ImportOptions) -> KernelStack:
    expression = re.escape(pattern.name)
    for name, part in _PARTS.items():
        expression = expression.replace(re.escape(name), part, 1)
    unknown = re.findall(r"\\\{(.*?)\\\}", expression)
    folder = pattern.parent
    refuse(
        [f"a pattern knows {', '.join(_PARTS)}; got {{{name}}}" for name in unknown]
        + ([] if folder.is_dir() else [f"there is no folder {folder}"])
    )
    matches = {file: re.fullmatch(expression, file.name) for file in sorted(folder.iterdir())}
    places = {_place(match): file for file, match in matches.items() if match is not None}
    if not places:
        raise ContractError(f"no file of {folder} fits {pattern.name}")
    return _of_places(places, options)


def _place(match: re.Match[str]) -> _Place:
    groups = match.groupdict()
    row, column = int(groups.get("row") or 0), int(groups.get("i") or groups.get("col") or 0)
    return row, column, groups.get("c") or ""


def _of_places(files: Mapping[_Place, Path], options: ImportOptions) -> KernelStack:
    """Join the kernels of files; every place must be there, and all alike."""
    rows, columns = (sorted({int(place[axis]) for place in files}) for axis in range(2))
    colours = sorted({place[2] for place in files})
    missing = [
        f"row {row} column {column} {colour}".rstrip()
        for row in rows
        for column in columns
        for colour in colours
        if (row, column, colour) not in files
    ]
    refuse([f"there is no file for {_few(missing)}"] if missing else [])
    single = ImportOptions(axes=options.axes, variable=options.variable)
    stacks = {place: _of_file(file, single) for place, file in files.items()}
    _check_alike({files[place]: stack for place, stack in stacks.items()})
    first = next(iter(stacks.values()))
    values = np.stack(
        [
            np.stack(
                [
                    np.concatenate([stacks[row, column, c].values[0, 0] for c in colours])
                    for column in columns
                ]
            )
            for row in rows
        ]
    )
    letters, waves = _colours(colours, first)
    if options.grid is not None:
        values = ordered(values.reshape(-1, *values.shape[2:]), _running(options), "the pattern")
    return KernelStack(
        values=values,
        pitch_um=first.pitch_um,
        colours=letters,
        wavelengths_um=waves,
        middle_px=first.middle_px,
        files=len(files),
        notes=tuple(dict.fromkeys(note for stack in stacks.values() for note in stack.notes)),
    )


def _running(options: ImportOptions) -> ImportOptions:
    return ImportOptions(axes="i,c,h,w", grid=options.grid)


def _check_alike(stacks: Mapping[Path, KernelStack]) -> None:
    (first_file, first), *others = stacks.items()
    faults = []
    if first.values.shape[:2] != (1, 1):
        faults.append(f"{first_file.name} holds several kernels; a file of a pattern holds one")
    for what in ("shape", "pitch", "middle"):
        differing = [f.name for f, stack in others if _fact(stack, what) != _fact(first, what)]
        if differing:
            faults.append(
                f"{_few(differing)} differ from {first_file.name} in their {what} "
                f"({_fact(first, what)})"
            )
    refuse(faults)


def _fact(stack: KernelStack, what: str) -> object:
    return {"shape": stack.values.shape, "pitch": stack.pitch_um, "middle": stack.middle_px}[what]


def _colours(
    names: Sequence[str], first: KernelStack
) -> tuple[str | None, tuple[float, ...] | None]:
    """Return letters or wavelengths of the colours that names of files state."""
    if names == [""]:
        return first.colours, first.wavelengths_um
    letters = "".join(names).upper()
    if set(letters) <= set(WAVELENGTH_OF):
        return letters, None
    try:
        waves = [float(name) for name in names]
    except ValueError:
        raise ContractError(
            f"{{c}} is R, G, B or a wavelength; the files have {', '.join(names)}"
        ) from None
    return None, tuple(wave / 1000 if wave > _NM_FROM else wave for wave in waves)


def _of_fields(files: Sequence[Path], options: ImportOptions) -> KernelStack:
    """Join listings of several fields and wavelengths of a lens of revolution."""
    listings = {file: read_listing(file) for file in files}
    faults = [f"{file.name} states no field" for file, one in listings.items() if one.field is None]
    faults += [
        f"{file.name} lies at x = {one.field[0]:g}: a folder holds fields along y, as of a lens of "
        "revolution; name the others by a pattern of rows and columns"
        for file, one in listings.items()
        if one.field is not None and one.field[0] != 0
    ]
    refuse(faults)
    table = {(abs(_height(one)), one.wavelength_um or 0.0): one for one in listings.values()}
    heights, waves = (sorted({key[axis] for key in table}) for axis in range(2))
    missing = [f"{h:g} at {w:g} um" for h in heights for w in waves if (h, w) not in table]
    refuse([f"there is no listing of the field {_few(missing)}"] if missing else [])
    ordered_listings = [[table[height, wave] for wave in waves] for height in heights]
    every = [one for field in ordered_listings for one in field]
    kinds = {(one.values.shape, one.spacing_um, one.middle_px) for one in every}
    if len(kinds) > 1:
        raise ContractError(
            f"the listings of {files[0].parent} differ in size, spacing or centre: "
            f"{_few([str(kind) for kind in sorted(map(str, kinds))])}"
        )
    return KernelStack(
        values=_joined(ordered_listings),
        pitch_um=every[0].spacing_um,
        wavelengths_um=tuple(waves) if waves != [0.0] else None,
        heights_mm=_heights_mm(heights, every[0].field_unit, options),
        middle_px=every[0].middle_px,
        files=len(files),
    )


def _height(listing: Listing) -> float:
    return 0.0 if listing.field is None else listing.field[1]


def _joined(listings: Sequence[Sequence[Listing]]) -> FloatGrid:
    return np.stack([np.stack([one.values for one in field]) for field in listings])[None]


def _heights_mm(
    fields: Sequence[float], unit: str, options: ImportOptions
) -> tuple[float, ...] | None:
    if options.heights_mm is not None:
        return tuple(options.heights_mm)
    if unit == "mm":
        return tuple(fields)
    raise ContractError(
        f"the listings state fields of {', '.join(f'{field:g}' for field in fields)} {unit}; state "
        f"how far from the axis they lie on the sensor by {option_text('heights_mm')} 0,A,B"
    )


def _few(names: Sequence[str]) -> str:
    more = len(names) - _MOST_NAMES
    return ", ".join(names[:_MOST_NAMES]) + (f" and {more} more" if more > 0 else "")
