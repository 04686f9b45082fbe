"""The same measured kernels as arrays, pictures and listings."""

import cv2
import numpy as np
import scipy.io

PITCH_UM = 2.5
ROWS, COLUMNS, SIDE = 3, 4, 11
SPAN = "9x6"
BOM_16 = "utf-16"


def counts(seed=3):
    """(row, column, R G B, h, w) of whole numbers below 2^16, each place and colour another.

    One tail of every kernel lies to the right of the middle and one below it, twice as far.
    """
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:SIDE, :SIDE] - SIDE // 2
    widths = 0.8 + 0.5 * rng.random((ROWS, COLUMNS, 3, 1, 1))
    kernels = np.exp(-(x**2 + y**2) / (2 * widths**2)) * 40000
    kernels[..., SIDE // 2, SIDE // 2 + 2] += 9000
    kernels[..., SIDE // 2 + 4, SIDE // 2] += 5000
    return np.rint(kernels)


def listing_text(values, *, header="0.4500 to 0.6500 µm at 0.0000, 0.0000 (deg).", middle=True):
    """A listing of one kernel as Zemax writes it."""
    h, w = values.shape
    lines = ["Listing of Huygens PSF Data", "", "File : lens.zmx", "Title: 50 mm at 4 m", ""]
    lines += [header, f"Data spacing is {PITCH_UM:.3f} µm.", f"Data area is {w * PITCH_UM:.3f} µm"]
    lines += ["Strehl ratio: 0.412", f"Image grid size: {w} by {h}"]
    lines += [f"Center point is: row {h // 2 + 1}, column {w // 2 + 1}"] if middle else []
    lines += ["", "Values are relative intensity.", ""]
    lines += ["\t".join(f"{v:.6E}" for v in row) for row in values]
    return "\n".join(lines) + "\n"


def write_all(folder, kernels):
    """Write one set of kernels in every way; give what the command takes for each."""
    np.save(folder / "psf.npy", kernels)
    np.savez(folder / "psf.npz", psf=kernels, pitch=PITCH_UM)
    scipy.io.savemat(folder / "psf.mat", {"psf": kernels})
    for name in ("png", "zemax"):
        (folder / name).mkdir()
    for row, column in np.ndindex(kernels.shape[:2]):
        kernel = kernels[row, column]
        picture = kernel[::-1].transpose(1, 2, 0).astype(np.uint16)  # OpenCV writes B, G, R
        cv2.imwrite(str(folder / "png" / f"psf_r{row}_c{column}.png"), picture)
        for letter, plane in zip("RGB", kernel, strict=True):
            path = folder / "zemax" / f"r{row + 1}_c{column + 1}_{letter}.txt"
            path.write_text(listing_text(plane), encoding=BOM_16)
    return {
        "npy": folder / "psf.npy",
        "npz": folder / "psf.npz",
        "mat": folder / "psf.mat",
        "png": folder / "png",
        "pattern": f"{folder}/png/psf_r{{row}}_c{{col}}.png",
        "zemax": f"{folder}/zemax/r{{row}}_c{{col}}_{{c}}.txt",
    }
