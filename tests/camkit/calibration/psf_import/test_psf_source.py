"""Kernels from files: the same data in any of them is the same PSF."""

import importlib.util

import numpy as np
import OpenEXR
import pytest
import scipy.io
import tifffile

from camkit.calibrate import import_psf
from camkit.errors import CamkitError, ContractError, DecodeError
from camkit.psf import PsfUncertainty
from tests.psf_files import COLUMNS, PITCH_UM, ROWS, SIDE, SPAN, counts, listing_text, write_all


def test_arrays_pictures_and_listings_of_the_same_data_give_equal_bits(tmp_path):
    sources = write_all(tmp_path, counts())
    written = {}
    for name, source in sources.items():
        out = tmp_path / f"{name}.safetensors"
        variable = "psf" if name == "npz" else None
        import_psf(source, out, pitch_um=PITCH_UM, span_mm=SPAN, variable=variable)
        written[name] = out.read_bytes()
    assert len(written) == 6
    assert len(set(written.values())) == 1


def test_kernels_lie_where_rows_and_columns_say_and_point_as_they_do_in_the_array(tmp_path):
    kernels = counts()
    np.save(tmp_path / "psf.npy", kernels)
    psf = import_psf(tmp_path / "psf.npy", pitch_um=PITCH_UM, span_mm=SPAN).psf
    assert psf.grid_x_mm.tolist() == [-4.5, -1.5, 1.5, 4.5]
    assert psf.grid_y_mm.tolist() == [-3.0, 0.0, 3.0]
    top_right = psf.kernels[COLUMNS - 1, 0]
    wanted = kernels[0, COLUMNS - 1, ::-1]  # blue first
    assert np.allclose(top_right, wanted / wanted.sum((-2, -1), keepdims=True), atol=1e-7)


@pytest.mark.parametrize("flip", ["x", "y", "xy"])
def test_a_file_that_runs_the_other_way_is_flipped_with_its_places(tmp_path, flip):
    kernels = counts()
    np.save(tmp_path / "right.npy", kernels)
    axes = [axis for name, pair in (("y", (0, 3)), ("x", (1, 4))) if name in flip for axis in pair]
    np.save(tmp_path / "other.npy", np.flip(kernels, axes))
    right, other = (
        import_psf(tmp_path / f"{name}.npy", pitch_um=PITCH_UM, span_mm=SPAN, flip=way).psf
        for name, way in (("right", ""), ("other", flip))
    )
    assert np.array_equal(right.kernels, other.kernels)


def test_kernels_of_a_correlation_are_turned_where_they_are(tmp_path):
    np.save(tmp_path / "right.npy", counts())
    np.save(tmp_path / "turned.npy", counts()[..., ::-1, ::-1])
    right, turned = (
        import_psf(tmp_path / f"{name}.npy", pitch_um=2.0, span_mm=SPAN, flip=flip).psf.kernels
        for name, flip in (("right", ""), ("turned", "kernels"))
    )
    assert np.array_equal(right, turned)


@pytest.mark.parametrize(
    ("axes", "order"),
    [("h,w,c,col,row", (3, 4, 2, 1, 0)), ("c,row,col,h,w", (2, 0, 1, 3, 4))],
)
def test_axes_may_come_in_any_order(tmp_path, axes, order):
    kernels = counts()
    np.save(tmp_path / "psf.npy", kernels.transpose(order))
    psf = import_psf(tmp_path / "psf.npy", axes=axes, pitch_um=PITCH_UM, span_mm=SPAN).psf
    np.save(tmp_path / "usual.npy", kernels)
    usual = import_psf(tmp_path / "usual.npy", pitch_um=PITCH_UM, span_mm=SPAN).psf
    assert np.array_equal(psf.kernels, usual.kernels)


def test_colours_of_numbered_places_are_not_taken_for_a_grid(tmp_path):
    kernels = counts()
    np.save(tmp_path / "flat.npy", kernels.reshape(-1, *kernels.shape[2:]))
    given = {"pitch_um": PITCH_UM, "span_mm": SPAN}
    with pytest.raises(ContractError, match="name its axes by axes"):
        import_psf(tmp_path / "flat.npy", **given)
    grid = "x".join(map(str, kernels.shape[:2]))
    flat = import_psf(tmp_path / "flat.npy", axes="i,c,h,w", grid=grid, **given).psf
    np.save(tmp_path / "usual.npy", kernels)
    assert np.array_equal(flat.kernels, import_psf(tmp_path / "usual.npy", **given).psf.kernels)


def test_deeplens_and_optiland_arrays_need_no_axes(tmp_path):
    np.save(tmp_path / "map.npy", counts()[:, :, :1].astype(np.float32))
    np.save(tmp_path / "fft.npy", np.pad(counts()[0, 0, 0], ((1, 0), (1, 0))))
    grid = import_psf(tmp_path / "map.npy", pitch_um=2.0, frame_mm="12x9")
    assert grid.psf.kernels.shape == (ROWS * COLUMNS, 1, 1, SIDE, SIDE)
    assert grid.psf.grid_x_mm.tolist() == [-4.5, -1.5, 1.5, 4.5]
    one = import_psf(tmp_path / "fft.npy", pitch_um=0.5)
    assert one.psf.symmetry == "uniform"
    assert one.psf.kernels.shape == (1, 1, 1, SIDE + 2, SIDE + 2)
    assert "no middle one" in one.notes[0]


def test_a_stack_of_pages_a_sheet_and_an_exr_are_read(tmp_path):
    grey = counts()[:, :, 1]
    tifffile.imwrite(tmp_path / "stack.tif", grey.reshape(-1, SIDE, SIDE).astype(np.uint16))
    sheet = grey.transpose(0, 2, 1, 3).reshape(ROWS * SIDE, COLUMNS * SIDE)
    tifffile.imwrite(tmp_path / "sheet.tif", sheet.astype(np.float32))
    options = {"grid": f"{ROWS}x{COLUMNS}", "pitch_um": PITCH_UM, "span_mm": SPAN}
    stack = import_psf(tmp_path / "stack.tif", axes="i,h,w", **options).psf
    tiles = import_psf(tmp_path / "sheet.tif", **options).psf
    assert np.array_equal(stack.kernels, tiles.kernels)
    kernel = counts()[0, 0].astype(np.float32)
    with OpenEXR.File({"type": OpenEXR.scanlineimage}, dict(zip("RGB", kernel, strict=True))) as f:
        f.write(str(tmp_path / "one.exr"))
    exr = import_psf(tmp_path / "one.exr", pitch_um=PITCH_UM).psf
    assert np.allclose(exr.kernels[0, 0, ::-1], kernel / kernel.sum((-2, -1), keepdims=True))


@pytest.mark.skipif(importlib.util.find_spec("h5py") is None, reason="needs h5py")
def test_matlab_7_3_is_read_with_its_axes_in_reverse(tmp_path):
    import h5py

    kernels = counts()
    with h5py.File(tmp_path / "psf.mat", "w", userblock_size=512) as file:
        file["psf"] = kernels.T
    scipy.io.savemat(tmp_path / "old.mat", {"psf": kernels})
    new, old = (
        import_psf(tmp_path / name, pitch_um=PITCH_UM, span_mm=SPAN).psf.kernels
        for name in ("psf.mat", "old.mat")
    )
    assert np.array_equal(new, old)


def test_matlab_7_3_without_h5py_is_refused_by_its_name(tmp_path, monkeypatch):
    (tmp_path / "psf.mat").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(600))
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(CamkitError, match=r"version 7\.3.*h5py.*-v7"):
        import_psf(tmp_path / "psf.mat", pitch_um=1.0)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-8", "utf-8-sig", "latin-1"])
def test_a_listing_states_spacing_wavelength_and_middle_in_any_encoding(tmp_path, encoding):
    path = tmp_path / "psf.txt"
    values = np.pad(counts()[0, 0, 0], ((0, 1), (0, 1)))
    header = "0.5876 to 0.5876 µm at 0.0000, 3.0000 mm."
    path.write_text(listing_text(values, header=header).replace("row 7", "row 6"), encoding)
    result = import_psf(path)
    assert result.psf.pixel_pitch_um == PITCH_UM
    assert result.psf.wavelengths_um.tolist() == [0.5876]
    assert result.normalised.middle_px == (5, 6)


def test_a_folder_of_listings_holds_fields_of_a_lens_of_revolution(tmp_path):
    for field in (0, 2, 5):
        for wave in ("0.4861", "0.6563"):
            header = f"{wave} to {wave} µm at 0.0000, {field}.0000 mm."
            text = listing_text(counts(field)[0, 0, 0], header=header)
            (tmp_path / f"{field}_{wave}.txt").write_text(text, "utf-16")
    psf = import_psf(tmp_path).psf
    assert psf.symmetry == "radial"
    assert psf.field_heights_mm.tolist() == [0, 2, 5]
    assert psf.wavelengths_um.tolist() == [0.4861, 0.6563]


def test_fields_in_degrees_need_their_heights(tmp_path):
    for field in (0, 7):
        header = f"0.55 µm at {field}.00 (deg)."
        (tmp_path / f"{field}.txt").write_text(listing_text(counts()[0, 0, 0], header=header))
    with pytest.raises(ContractError, match=r"fields of 0, 7 deg.*heights_mm"):
        import_psf(tmp_path)
    assert import_psf(tmp_path, heights_mm="0,3.1").psf.field_heights_mm.tolist() == [0, 3.1]


def test_a_cut_off_listing_and_a_cross_section_are_refused(tmp_path):
    text = listing_text(counts()[0, 0, 0])
    (tmp_path / "short.txt").write_text(text.rsplit("\n", 3)[0])
    (tmp_path / "cross.txt").write_text("Listing of FFT PSF Cross Section\n1 2\n3 4\n")
    for name, words in (("short", "is it cut off"), ("cross", "the whole PSF")):
        with pytest.raises(DecodeError, match=words):
            import_psf(tmp_path / f"{name}.txt")


def test_one_message_names_every_fault(tmp_path):
    kernels = counts()
    kernels[0, 1] = 0
    kernels[2, 2, 0, 0, 0] = np.nan
    np.save(tmp_path / "psf.npy", kernels)
    with pytest.raises(ContractError) as caught:
        import_psf(tmp_path / "psf.npy")
    for words in (
        "span_mm",
        "pitch_um",
        "NaN or infinite values in row 2 column 2 colour 0",
        "no light in row 0 column 1 colour 0",
    ):
        assert words in str(caught.value)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"axes": "row,col,h,w"}, "5 axes"),
        ({"axes": "row,col,c,h"}, "with h and w"),
        ({"colours": "RG"}, "colours names 2 colours"),
        ({"colours": "RGX"}, "order of R, G and B"),
        ({"span_mm": "9"}, "WIDTHxHEIGHT"),
        ({"span_mm": SPAN, "frame_mm": SPAN}, "use one of"),
        ({"x_mm": "1,2,3,4"}, "y_mm is missing"),
        ({"side_px": 4}, "odd"),
        ({"flip": "z"}, "x, y, xy, kernels"),
        ({"uncertainty": "1,2"}, "NOISE,SHIFT_PX,WIDTH"),
        ({"colours": "RGB", "wavelengths_um": "0.4,0.5,0.6"}, "colours or of wavelengths"),
    ],
)
def test_a_wrong_option_is_named(tmp_path, options, words):
    np.save(tmp_path / "psf.npy", counts())
    places = {} if {"span_mm", "frame_mm", "x_mm"} & options.keys() else {"span_mm": SPAN}
    with pytest.raises(ContractError, match=words):
        import_psf(tmp_path / "psf.npy", pitch_um=2.0, **places, **options)


def test_missing_files_of_a_pattern_are_named_together(tmp_path):
    source = write_all(tmp_path, counts())["pattern"]
    (tmp_path / "png" / "psf_r0_c1.png").unlink()
    (tmp_path / "png" / "psf_r2_c3.png").unlink()
    with pytest.raises(ContractError, match="row 0 column 1, row 2 column 3"):
        import_psf(source, pitch_um=2.0, span_mm=SPAN)


def test_objects_in_an_array_and_other_files_are_refused(tmp_path):
    np.save(tmp_path / "object.npy", np.array([{}]), allow_pickle=True)
    (tmp_path / "psf.pdf").touch()
    for name, words in (("object.npy", "no plain array"), ("psf.pdf", "expected .npy")):
        with pytest.raises(CamkitError, match=words):
            import_psf(tmp_path / name)


def test_background_negative_values_and_the_middle_are_normalised_and_reported(tmp_path):
    kernel = np.zeros((9, 9))
    kernel[3, 5], kernel[3, 6] = 300, 100
    np.save(tmp_path / "psf.npy", kernel + 10)
    result = import_psf(tmp_path / "psf.npy", pitch_um=1.0, background="border", centre="peak")
    assert result.normalised.middle_px == (3, 5)
    kernels = result.psf.kernels[0, 0, 0]
    middle = kernels.shape[0] // 2
    assert kernels[middle, middle : middle + 2].tolist() == [0.75, 0.25]
    kept = import_psf(tmp_path / "psf.npy", pitch_um=1.0)
    assert any("background" in note for note in kept.notes)
    np.save(tmp_path / "psf.npy", kernel - 1)
    negative = import_psf(tmp_path / "psf.npy", pitch_um=1.0)
    assert negative.normalised.negative_share == pytest.approx(79 / 398)


def test_an_uncertainty_travels_in_the_file(tmp_path):
    from camkit.bundle.psf_file import read_measurement, read_psf

    np.save(tmp_path / "psf.npy", counts())
    out = tmp_path / "psf.safetensors"
    result = import_psf(
        tmp_path / "psf.npy", out, pitch_um=2.0, span_mm=SPAN, uncertainty=(0.02, 0.1, 0.03)
    )
    psf, uncertainty = read_measurement(out)
    assert uncertainty == PsfUncertainty(noise=0.02, shift_px=0.1, width=0.03)
    assert np.array_equal(psf.kernels, result.psf.kernels)
    assert np.array_equal(read_psf(out).kernels, psf.kernels)
