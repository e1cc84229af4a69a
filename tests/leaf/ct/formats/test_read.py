"""What is written is read again; what a file does not say is asked for; what is broken is refused in one line."""

import errno
import logging
import struct
import sys

import numpy as np
import pytest
import tifffile

import o3dleaf as o3l
from o3dleaf import Volume, read_volume, write_volume
from o3dleaf.core.errors import InputError
from o3dleaf.leaf.ct.formats.counts import count_voxels
from tolerances import ROUND_TRIP_SPACING


@pytest.fixture
def volume():
    data = np.random.default_rng(1).normal(size=(5, 7, 9)).astype(np.float32)
    return Volume(data, (24.0, 3.71, 1 / 3), (1.0, 2.5, -3.0), "um")


def pages(volume):
    """The (page, row, column) stack, spelled out voxel by voxel."""
    nx, ny, nz = volume.shape
    return np.array([[[volume.data[i, j, k] for i in range(nx)] for j in range(ny)] for k in range(nz)])


def assert_same(read, volume, *, lattice=True):
    assert read.shape == volume.shape
    assert np.array_equal(read.data, volume.data)
    if lattice:
        assert np.allclose(read.spacing, volume.spacing, rtol=ROUND_TRIP_SPACING, atol=0)
        assert np.allclose(read.origin, volume.origin, rtol=ROUND_TRIP_SPACING, atol=0)
        assert read.unit == volume.unit


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
def test_round_trip_with_three_different_sizes(tmp_path, volume, kind):
    volume = Volume((volume.data * 50 + 100).astype(kind), volume.spacing, volume.origin, "um")
    write_volume(volume, tmp_path / "v.tif")
    read = read_volume(tmp_path / "v.tif")
    assert read.data.dtype == kind
    assert_same(read, volume)
    assert np.array_equal(tifffile.imread(tmp_path / "v.tif"), pages(volume))
    assert [f.name for f in tmp_path.iterdir()] == ["v.tif"]


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
def test_bytes_in_either_order_are_the_same_numbers(tmp_path, order, kind):
    """Fiji writes the most significant one first."""
    stack = np.arange(5 * 16 * 17).reshape(5, 16, 17).astype(kind)
    tifffile.imwrite(tmp_path / "v.tif", stack, metadata=None, photometric="minisblack", byteorder=order)
    assert np.array_equal(read_volume(tmp_path / "v.tif", spacing=1.0).data, np.transpose(stack))


def test_doubles_become_single_precision_and_a_unit_may_be_missing(tmp_path, volume):
    write_volume(Volume(volume.data.astype(float), volume.spacing), tmp_path / "v.tif")
    read = read_volume(tmp_path / "v.tif")
    assert read.unit is None
    assert np.array_equal(read.data, volume.data)


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path, volume, monkeypatch):
    target = tmp_path / "v.tif"
    write_volume(volume, target)
    before = target.read_bytes()

    def fail(path, *_, **__):
        path.write_bytes(b"half")
        raise OSError(errno.ENOSPC, "disk full")

    monkeypatch.setattr(tifffile, "imwrite", fail)
    with pytest.raises(o3l.errors.O3DLeafError, match="disk full"):
        write_volume(volume, target)
    assert [f.name for f in tmp_path.iterdir()] == ["v.tif"]
    assert target.read_bytes() == before


def test_a_path_given_first_is_refused_and_nothing_is_written(tmp_path, volume):
    with pytest.raises(o3l.errors.InputError, match=r"write_volume\(volume, path\)"):
        write_volume(tmp_path / "v.tif", volume)
    assert not list(tmp_path.iterdir())


def test_stated_lengths_are_converted_and_arguments_win(tmp_path, volume):
    write_volume(volume, tmp_path / "v.tif")
    in_mm = read_volume(tmp_path / "v.tif", unit="mm")
    assert in_mm.unit == "mm"
    assert np.allclose(in_mm.spacing, volume.spacing * 1e-3, rtol=ROUND_TRIP_SPACING)
    assert np.allclose(in_mm.origin, volume.origin * 1e-3, rtol=ROUND_TRIP_SPACING)
    given = read_volume(tmp_path / "v.tif", spacing=(1, 2, 3), unit="mm", origin=(4, 5, 6))
    assert np.array_equal([given.spacing, given.origin], [[1, 2, 3], [4, 5, 6]])
    assert given.unit == "mm"
    half = read_volume(tmp_path / "v.tif", spacing=12.0)
    assert half.unit == "um"
    assert np.array_equal(half.origin, [0, 0, 0])


def test_ome_metadata_is_honoured(tmp_path, volume):
    stated = {
        "axes": "ZYX",
        "PhysicalSizeX": 24.0,
        "PhysicalSizeXUnit": "µm",
        "PhysicalSizeY": 3.7,
        "PhysicalSizeZ": 0.0005,
        "PhysicalSizeZUnit": "mm",
    }
    tifffile.imwrite(tmp_path / "v.ome.tif", pages(volume), metadata=stated)
    read = read_volume(tmp_path / "v.ome.tif")
    assert_same(read, volume, lattice=False)
    assert np.allclose(read.spacing, [24.0, 3.7, 0.5], rtol=ROUND_TRIP_SPACING)
    assert read.unit == "um"


@pytest.mark.parametrize("compression", [None, "zlib"])
def test_a_plain_multi_page_tiff_needs_a_spacing(tmp_path, volume, compression):
    tifffile.imwrite(tmp_path / "v.tif", pages(volume), metadata=None, compression=compression)
    with pytest.raises(o3l.errors.InputError, match="spacing"):
        read_volume(tmp_path / "v.tif")
    assert_same(read_volume(tmp_path / "v.tif", spacing=24, unit="um"), volume, lattice=False)


def test_slices_are_stacked_by_number(tmp_path, volume):
    stack = np.concatenate([pages(volume)] * 2)
    for k, page in enumerate(stack):
        tifffile.imwrite(tmp_path / f"slice_{k}.tif", page, metadata=None)
    (tmp_path / "notes.txt").write_text("not a slice")
    read = read_volume(tmp_path, spacing=3.0)
    assert np.array_equal(read.data, stack.transpose(2, 1, 0))
    tifffile.imwrite(tmp_path / "slice_3.tif", stack[3][:-1], metadata=None)
    with pytest.raises(o3l.errors.InputError, match=r"slice_3\.tif"):
        read_volume(tmp_path, spacing=3.0)


@pytest.mark.parametrize(("numbers", "whole"), [((1, 2, 4, 5), False), ((8, 9, 10, 11), True), ((0, 5, 10, 15), True)])
def test_a_slice_that_is_missing_by_its_number_is_noticed(tmp_path, volume, numbers, whole):
    for k, page in zip(numbers, pages(volume), strict=False):
        tifffile.imwrite(tmp_path / f"leaf2_{k}.tif", page, metadata=None)
    if whole:
        assert read_volume(tmp_path, spacing=3.0).shape[2] == 4
    else:
        with pytest.raises(o3l.errors.InputError, match=r"leaf2_4\.tif follows leaf2_2\.tif"):
            read_volume(tmp_path, spacing=3.0)


def test_numpy_arrays_are_in_our_order(tmp_path, volume):
    np.save(tmp_path / "v.npy", volume.data)
    assert_same(read_volume(tmp_path / "v.npy", spacing=1.0), volume, lattice=False)
    with pytest.raises(o3l.errors.InputError, match="spacing"):
        read_volume(tmp_path / "v.npy")


@pytest.mark.parametrize("name", ["v.nrrd", "v.mha", "v.nii", "v.nii.gz"])
def test_other_formats_through_simpleitk(tmp_path, volume, name):
    itk = pytest.importorskip("SimpleITK", reason="the extra `formats` is not installed")
    image = itk.GetImageFromArray(pages(volume))
    image.SetSpacing((0.024, 0.0037, 0.002))
    image.SetOrigin((0.001, 0.0025, -0.003))
    itk.WriteImage(image, str(tmp_path / name))
    read = read_volume(tmp_path / name, unit="um")
    assert_same(read, volume, lattice=False)
    # NIfTI keeps its lengths in single precision.
    assert np.allclose(read.spacing, [24.0, 3.7, 2.0], rtol=1e-6)
    assert np.allclose(read.origin, [1.0, 2.5, -3.0], rtol=1e-6)
    whole = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(whole[: len(whole) // 2])
    with pytest.raises(o3l.errors.InputError, match=name.split(".")[0]):
        read_volume(tmp_path / name)


def test_without_simpleitk_the_message_says_what_to_install(tmp_path, monkeypatch):
    (tmp_path / "v.nrrd").write_bytes(b"NRRD0004\n")
    monkeypatch.setitem(sys.modules, "SimpleITK", None)
    with pytest.raises(o3l.errors.InputError, match=r"pip install 'o3dleaf\[formats\]'"):
        read_volume(tmp_path / "v.nrrd")


@pytest.mark.parametrize("options", [{}, {"bigtiff": True}, {"byteorder": ">"}, {"compression": "zlib"}])
def test_pages_that_are_missing_are_noticed_whatever_becomes_of_logs(tmp_path, volume, options, monkeypatch):
    """tifffile only logs it, and gives the pages before them for the stack."""
    monkeypatch.setattr(logging.getLogger("tifffile"), "disabled", True)
    tifffile.imwrite(tmp_path / "v.tif", pages(volume), metadata=None, **options)
    assert np.array_equal(read_volume(tmp_path / "v.tif", spacing=1.0).data, volume.data)
    with tifffile.TiffFile(tmp_path / "v.tif") as tiff:
        ends = [page.offset for page in tiff.pages]
    content = (tmp_path / "v.tif").read_bytes()
    for end in ends[1:]:
        (tmp_path / "v.tif").write_bytes(content[:end])
        with pytest.raises(o3l.errors.InputError, match=r"page .* is not where"):
            read_volume(tmp_path / "v.tif", spacing=1.0)


@pytest.mark.parametrize(("imagej", "compression"), [(True, None), (False, None), (False, "zlib")])
def test_no_truncation_goes_unnoticed(tmp_path, volume, imagej, compression):
    whole, cut = tmp_path / "v.tif", tmp_path / "cut.tif"
    if imagej:
        write_volume(volume, whole)
    else:
        tifffile.imwrite(whole, pages(volume), metadata=None, compression=compression)
    content = whole.read_bytes()
    for size in range(1, len(content), 37):
        cut.write_bytes(content[:size])
        try:
            read = read_volume(cut, spacing=1.0)
        except o3l.errors.InputError as error:
            assert "\n" not in str(error)  # noqa: PT017 - either an error or the whole volume will do
        else:
            assert np.array_equal(read.data, volume.data)


def test_a_header_that_promises_too_much_allocates_nothing(tmp_path):
    tifffile.imwrite(
        tmp_path / "v.tif",
        np.zeros((4, 100, 100), np.uint16),
        metadata=None,
        compression="zlib",
        photometric="minisblack",
    )
    content = bytearray((tmp_path / "v.tif").read_bytes())
    with tifffile.TiffFile(tmp_path / "v.tif") as tiff:
        spots = [page.tags["ImageWidth"].valueoffset for page in tiff.pages]
    for spot in spots:
        content[spot : spot + 4] = (2_000_000_000).to_bytes(4, sys.byteorder)
    (tmp_path / "v.tif").write_bytes(content)
    with pytest.raises(o3l.errors.InputError):
        read_volume(tmp_path / "v.tif", spacing=1.0)
    np.save(tmp_path / "v.npy", np.zeros((4, 5, 6)))
    header = (tmp_path / "v.npy").read_bytes().replace(b"(4, 5, 6)", b"(4, 5, 9000000000)")[:-400]
    (tmp_path / "v.npy").write_bytes(header)
    with pytest.raises(o3l.errors.InputError):
        read_volume(tmp_path / "v.npy", spacing=1.0)


@pytest.mark.parametrize(
    ("array", "says"),
    [
        (np.zeros((4, 5, 6, 3), np.uint8), "color"),
        (np.zeros((4, 5, 3), np.uint8), "one value"),
        (np.full((4, 5, 6), 7, np.uint16), "one value"),
        (np.full((4, 5, 6), np.nan, np.float32), "NaN"),
        (np.arange(30, dtype=np.uint8).reshape(5, 6), "at least 2"),
    ],
)
def test_what_is_no_grey_volume_is_refused(tmp_path, array, says):
    tifffile.imwrite(tmp_path / "v.tif", array, photometric="rgb" if array.ndim == 4 else "minisblack")
    with pytest.raises(o3l.errors.InputError, match=says):
        read_volume(tmp_path / "v.tif", spacing=1.0)


@pytest.mark.parametrize("name", ["absent.tif", "empty.tif", "text.tif", "text.npy", "text.xyz", "folder"])
def test_what_cannot_be_read_is_refused(tmp_path, name):
    (tmp_path / "empty.tif").touch()
    (tmp_path / "folder").mkdir()
    for text in ("text.tif", "text.npy", "text.xyz"):
        (tmp_path / text).write_text("hello, this is not a volume")
    with pytest.raises(o3l.errors.InputError, match=name) as error:
        read_volume(tmp_path / name, spacing=1.0)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("head", "says"),
    [
        (b"\0" * 128 + b"DICM", r"looks like DICOM, give it the suffix \.dcm"),
        (b"\x89HDF\r\n\x1a\n", r"looks like HDF5, give it the suffix \.h5"),
        (b"CTDATA-HEADER_V1", r"\.isq"),
        (b"PK\x03\x04", "unpack it"),
        (b"nothing known", "slices$"),
    ],
)
def test_a_file_of_an_unknown_kind_is_told_by_its_content(tmp_path, head, says):
    (tmp_path / "scan.001").write_bytes(head)
    with pytest.raises(o3l.errors.InputError, match=says):
        read_volume(tmp_path / "scan.001", spacing=1.0)


def test_pages_that_lead_back_to_one_before_are_refused_and_not_counted_without_end(tmp_path):
    path = tmp_path / "ct.tif"
    with tifffile.TiffWriter(path, byteorder="<") as tiff:
        for side in (8, 9, 8):
            tiff.write(np.zeros((side, side), np.uint8), metadata=None, photometric="minisblack")
    with tifffile.TiffFile(path) as tiff:
        first, *_, last = (page.offset for page in tiff.pages)
    content = bytearray(path.read_bytes())
    following = last + 2 + 12 * struct.unpack_from("<H", content, last)[0]
    assert content[following : following + 4] == bytes(4)
    content[following : following + 4] = struct.pack("<I", first)
    path.write_bytes(content)
    assert count_voxels(path) == 0
    with pytest.raises(InputError, match="page 4 is not where it is said to be"):
        read_volume(path)
