"""Volumes that the format's own library wrote come back voxel by voxel, with their lattice; cut-off ones do not."""

import gzip
import json
import pickle
import struct
import zlib

import numpy as np
import pytest

import o3dleaf as o3l
from o3dleaf import read_volume
from tolerances import ROUND_TRIP_SPACING

SPACING = (0.003, 0.0045, 0.008)
"""In millimeters, along (x, y, z)."""
ORIGIN = (0.1, -0.2, 0.3)


@pytest.fixture
def voxels():
    return np.random.default_rng(3).integers(-3000, 3000, (5, 7, 9)).astype(np.int16)


def slices_first(voxels):
    """The (z, y, x) array, spelled out voxel by voxel."""
    nx, ny, nz = voxels.shape
    return np.array([[[voxels[i, j, k] for i in range(nx)] for j in range(ny)] for k in range(nz)])


def write_aim(path, voxels):
    py_aimio = pytest.importorskip("py_aimio", reason="aimio-py is not installed")
    py_aimio.write_aim(str(path), slices_first(voxels), {"element_size": SPACING, "dimensions": voxels.shape})


def write_isq(path, voxels):
    """ISQ has no writer: the header as Scanco describes it."""
    head = np.zeros(128, dtype="<i4")
    head[:4] = np.frombuffer(b"CTDATA-HEADER_V1", dtype="<i4")
    head[4] = 3
    head[5] = head[6] = voxels.nbytes // 512 + 1
    head[11:14] = voxels.shape
    head[14:17] = np.round(np.array(SPACING) * 1e3 * voxels.shape)  # sides of the whole, in micrometers
    path.write_bytes(head.tobytes() + slices_first(voxels).astype("<i2").tobytes())


def write_old_aim(path, voxels, kind=0x20002, data=None):
    """As on VAX; aimio writes the newer version only."""
    head = struct.pack("<6i", 16, 0, 0, 0, 0, kind) + struct.pack("<3i", 1, 2, 3) + struct.pack("<3i", *voxels.shape)
    vax = [struct.pack("<f", 4 * size) for size in SPACING]
    head += bytes(60) + b"".join(size[2:] + size[:2] for size in vax) + bytes(20)
    data = slices_first(voxels).tobytes() if data is None else data
    path.write_bytes(struct.pack("<5i", 20, len(head), 6, len(data), 0) + head + b"a log\0" + data)


def runs_of(voxels, word):
    values = slices_first(voxels).astype(np.int8).ravel()
    pairs = b"".join(struct.pack("<bB", value, 1) for value in values.tolist())
    return (word + len(pairs)).to_bytes(word, "little") + pairs


def write_hdf5(path, voxels, **options):
    h5py = pytest.importorskip("h5py", reason="the extra `formats` is not installed")
    with h5py.File(path, "w") as file:
        scan = file.create_dataset("scan/raw", data=slices_first(voxels), **options)
        scan.attrs["element_size_um"] = 1e3 * np.array(SPACING)[::-1]
        file["log"] = np.arange(5)


def write_packed_hdf5(path, voxels):
    write_hdf5(path, voxels, compression="gzip", chunks=(3, 4, 5))


def ome(version, image):
    return {"ome": {"version": "0.5", "multiscales": [image]}} if version == 3 else {"multiscales": [image]}


def write_zarr(path, voxels, version=3, order="zyx"):
    zarr = pytest.importorskip("zarr", reason="the extra `formats` is not installed")
    group = zarr.create_group(path, zarr_format=version)
    array = voxels.transpose(["xyz".index(axis) for axis in order])
    group.create_array("0", data=array[None].copy(), chunks=(1, 3, 4, 5))
    group.create_array("1", data=array[None, ::2, ::2, ::2].copy(), chunks=(1, 3, 4, 5))
    axes = [{"name": "c", "type": "channel"}]
    axes += [{"name": axis, "type": "space", "unit": "micrometer"} for axis in order]
    scale = [1.0, *(1e3 * SPACING["xyz".index(axis)] for axis in order)]
    move = [0.0, *(1e3 * ORIGIN["xyz".index(axis)] for axis in order)]
    levels = [
        {
            "path": str(k),
            "coordinateTransformations": [
                {"type": "scale", "scale": [scale[0], *(2**k * each for each in scale[1:])]},
                {"type": "translation", "translation": move},
            ],
        }
        for k in range(2)
    ]
    group.attrs.update(ome(version, {"axes": axes, "datasets": levels}))


def write_old_zarr(path, voxels):
    write_zarr(path, voxels, version=2, order="xyz")


def write_dicom(folder, voxels, packing=None):
    itk = pytest.importorskip("SimpleITK", reason="the extra `formats` is not installed")
    folder.mkdir()
    for k, page in enumerate(slices_first(voxels)):
        image = itk.GetImageFromArray(page[None])
        image.SetSpacing(SPACING)
        facts = {
            "0008|0060": "CT",
            "0020|000e": "1.2.826.0.1.3680043.2.1125.1",
            "0020|0037": "1\\0\\0\\0\\1\\0",
            "0020|0032": "\\".join(f"{x:.6f}" for x in (ORIGIN[0], ORIGIN[1], ORIGIN[2] + SPACING[2] * k)),
            "0020|0013": str(k),
            "0018|0050": str(SPACING[2]),
        }
        for key, value in facts.items():
            image.SetMetaData(key, value)
        writer = itk.ImageFileWriter()
        writer.KeepOriginalImageUIDOn()
        if packing is not None:
            writer.SetUseCompression(True)
            writer.SetCompressor(packing)
        writer.SetFileName(str(folder / f"IM{k:04}.dcm"))
        writer.Execute(image)


WRITERS = {
    "v.aim": (write_aim, False),
    "v.isq": (write_isq, False),
    "v.h5": (write_hdf5, False),
    "v.hdf5": (write_packed_hdf5, False),
    "v.zarr": (write_zarr, True),
    "old.zarr": (write_old_zarr, True),
    "dicom": (write_dicom, True),
}
"""What writes a file of each name, and whether it states an origin."""


@pytest.mark.parametrize("name", list(WRITERS))
def test_a_volume_comes_back_with_its_lattice(tmp_path, voxels, name):
    write, places = WRITERS[name]
    write(tmp_path / name, voxels)
    read = read_volume(tmp_path / name, unit="mm")
    assert np.array_equal(read.data, voxels)
    # AIM keeps lengths in single precision, ISQ the sides of the whole in micrometers.
    assert np.allclose(read.spacing, SPACING, rtol=1 / 30 if name == "v.isq" else 1e-6)
    assert np.allclose(read.origin, ORIGIN if places else 0.0, rtol=ROUND_TRIP_SPACING)
    assert np.allclose(read_volume(tmp_path / name, unit="um").spacing, 1e3 * read.spacing)


@pytest.mark.parametrize("name", ["v.aim", "v.isq", "v.h5", "v.hdf5"])
def test_a_file_that_was_cut_off_is_refused(tmp_path, voxels, name):
    WRITERS[name][0](tmp_path / name, voxels)
    whole = (tmp_path / name).read_bytes()
    # An HDF5 file ends with its attributes, an AIM file with its log.
    for size in np.linspace(1, len(whole) - 1, 40).astype(int):
        (tmp_path / name).write_bytes(whole[:size])
        try:
            read = read_volume(tmp_path / name, unit="mm")
        except o3l.errors.InputError as error:
            assert "\n" not in str(error)  # noqa: PT017 - either an error or the whole volume will do
        else:
            assert np.array_equal(read.data, voxels)


@pytest.mark.parametrize("kind", ["int8", "int16", "float32", "old int16", "old int8", "old float32", "old runs"])
def test_aim_is_what_its_own_library_writes(tmp_path, voxels, kind):
    py_aimio = pytest.importorskip("py_aimio", reason="aimio-py is not installed")
    path, small = tmp_path / "v.aim", voxels % 100
    small[1:3] = 7  # runs
    if kind == "old int16":
        write_old_aim(path, voxels)
    elif kind == "old int8":
        write_old_aim(path, small.astype(np.int8), 0x10001)
    elif kind == "old float32":
        vax = [struct.pack("<f", 4 * value) for value in slices_first(voxels).ravel()]
        write_old_aim(path, voxels, 0x40004, b"".join(value[2:] + value[:2] for value in vax))
    elif kind == "old runs":
        write_old_aim(path, small, 0x80002, runs_of(small, 4))
    else:
        place = {"element_size": SPACING, "dimensions": voxels.shape, "position": (3, 1, 2), "offset": (0, 0, 0)}
        py_aimio.write_aim(str(path), slices_first(small if kind == "int8" else voxels).astype(kind), place)
    read, facts = read_volume(path, unit="mm"), py_aimio.aim_info(str(path))
    assert np.array_equal(read.data, voxels if "16" in kind or "32" in kind else small)
    assert np.allclose(read.spacing, facts["element_size"], rtol=1e-6)
    assert np.allclose(read.spacing, SPACING, rtol=1e-6)
    assert np.allclose(read.origin, facts["origin"], rtol=1e-6)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (lambda runs: runs[:-4], "bytes of runs"),
        (lambda runs: runs[:4] + runs[6:] + b"\0\0", "voxels for"),
        (lambda runs: b"\xff\xff\xff\x7f" + runs[4:], "bytes of runs"),
        (lambda runs: b"\0\0\0\0" + runs[4:], "bytes of runs"),
        (lambda runs: runs[:5] + b"\2" + runs[6:], "voxels for"),
    ],
)
def test_runs_that_do_not_make_the_voxels_are_refused(tmp_path, voxels, data, says):
    """The format's own library leaves what no run covers as it finds it in memory."""
    write_old_aim(tmp_path / "v.aim", voxels, 0x80002, data(runs_of(voxels % 100, 4)))
    with pytest.raises(o3l.errors.InputError, match=says):
        read_volume(tmp_path / "v.aim")


def test_a_mask_is_no_scan(tmp_path, voxels):
    write_old_aim(tmp_path / "v.aim", voxels, 0x150001)
    with pytest.raises(o3l.errors.InputError, match=r"v.aim: holds voxels of kind 0x00150001.*gray values"):
        read_volume(tmp_path / "v.aim")


def test_a_dicom_series_without_one_of_its_slices_is_refused(tmp_path, voxels):
    write_dicom(tmp_path / "scan", voxels)
    (tmp_path / "scan" / "IM0004.dcm").unlink()
    with pytest.raises(o3l.errors.InputError, match=r"missing.*from slice 4 to the next"):
        read_volume(tmp_path / "scan")


def test_slices_of_dicom_are_sorted_by_their_places_not_by_their_names(tmp_path, voxels):
    write_dicom(tmp_path / "scan", voxels)
    (tmp_path / "mixed").mkdir()
    for k, file in enumerate(sorted((tmp_path / "scan").iterdir())):
        (tmp_path / "mixed" / f"{7 * k % 9}.ima").write_bytes(file.read_bytes())
    (tmp_path / "mixed" / "notes.txt").write_text("of the scanner")
    assert np.array_equal(read_volume(tmp_path / "mixed", unit="mm").data, voxels)


@pytest.mark.parametrize("packing", ["JPEG", "JPEG2000"])
def test_packed_dicom_is_unpacked_to_the_same_voxels(tmp_path, packing):
    voxels = np.random.default_rng(3).integers(0, 3000, (20, 24, 2)).astype(np.int16)
    write_dicom(tmp_path / "scan", voxels, packing)
    read = read_volume(tmp_path / "scan", unit="mm")
    assert np.array_equal(read.data, voxels)
    assert np.allclose(read.spacing, SPACING)


@pytest.mark.parametrize(
    ("end", "says"),
    [
        ("os._exit(3)", "exit code 3"),
        ("os.abort()", "SIGABRT"),
        ("bytearray(1 << 33)", "MemoryError"),
        ("time.sleep(60)", "did not end within 3"),
    ],
)
def test_what_a_codec_does_to_its_process_is_one_line(tmp_path, monkeypatch, end, says):
    """A codec that ends, breaks, takes all memory or hangs: only the process that it is in does."""
    from o3dleaf.leaf.ct.formats import itk

    write_dicom(tmp_path / "scan", np.random.default_rng(3).integers(0, 3000, (20, 24, 2)).astype(np.int16), "JPEG")
    (tmp_path / "SimpleITK.py").write_text(f"import os, time\n{end}\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(itk, "CHILD_SECONDS", 3)
    with pytest.raises(o3l.errors.InputError, match=f"unpacking: .*{says}") as raised:
        read_volume(tmp_path / "scan", unit="mm")
    assert "\n" not in str(raised.value)


def test_voxels_in_other_files_are_not_looked_for(tmp_path):
    h5py = pytest.importorskip("h5py", reason="the extra `formats` is not installed")
    (tmp_path / "secret").write_bytes(bytes(range(120)))
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["scan"] = np.arange(120, dtype=np.uint8).reshape(4, 5, 6)
    with h5py.File(tmp_path / "outside.h5", "w") as file:
        file.create_dataset("scan", (4, 5, 6), "u1", external=[(str(tmp_path / "secret"), 0, 120)])
    with h5py.File(tmp_path / "virtual.h5", "w") as file:
        layout = h5py.VirtualLayout((4, 5, 6), "u1")
        layout[...] = h5py.VirtualSource(str(tmp_path / "other.h5"), "scan", (4, 5, 6))
        file.create_virtual_dataset("scan", layout)
    with h5py.File(tmp_path / "link.h5", "w") as file:
        file["scan"] = h5py.ExternalLink(str(tmp_path / "other.h5"), "scan")
    for name, says in (("outside", "in other files"), ("virtual", "in other files"), ("link", "0 arrays")):
        with pytest.raises(o3l.errors.InputError, match=says):
            read_volume(tmp_path / f"{name}.h5", spacing=1)


class Mark:
    """Unpickling it makes a file."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


@pytest.mark.parametrize("where", ["compressor", "filters"])
def test_a_pickle_in_a_zarr_folder_is_not_loaded(tmp_path, where):
    pytest.importorskip("zarr", reason="the extra `formats` is not installed")
    folder = tmp_path / "a.zarr"
    folder.mkdir()
    codec = {"id": "pickle", "protocol": 5}
    facts = {"zarr_format": 2, "shape": [2, 3, 4], "chunks": [2, 3, 4], "dtype": "<i2", "fill_value": 0, "order": "C"}
    facts |= {"compressor": None, "filters": None, where: codec if where == "compressor" else [codec]}
    (folder / ".zarray").write_text(json.dumps(facts))
    (folder / "0.0.0").write_bytes(pickle.dumps(Mark(tmp_path / "ran")))
    with pytest.raises(o3l.errors.InputError, match=r"a\.zarr"):
        read_volume(folder, spacing=1)
    assert not (tmp_path / "ran").exists()


def test_only_codecs_that_are_known_unpack_zarr(tmp_path, monkeypatch, voxels):
    """Those of numcodecs make objects too: what this version of zarr takes for one changes with the version."""
    from o3dleaf.leaf.ct.formats import ome_zarr

    write_zarr(tmp_path / "a.zarr", voxels)
    monkeypatch.setattr(ome_zarr, "CODECS", {"bytes"})
    with pytest.raises(o3l.errors.InputError, match="packed by zstd"):
        read_volume(tmp_path / "a.zarr")


@pytest.mark.parametrize("spoil", ["cut", "unpacked", "packed"])
def test_a_chunk_of_blosc_that_states_another_size_is_refused(tmp_path, voxels, spoil):
    """The library for it reads on, into other memory, and gives what it finds."""
    write_old_zarr(tmp_path / "a.zarr", voxels)
    assert json.loads((tmp_path / "a.zarr" / "0" / ".zarray").read_text())["compressor"]["id"] == "blosc"
    file = max(each for each in (tmp_path / "a.zarr" / "0").iterdir() if not each.name.startswith("."))
    content = bytearray(file.read_bytes())
    if spoil == "cut":
        del content[-7:]
    else:
        content[{"unpacked": 7, "packed": 14}[spoil]] = 0x7F
    file.write_bytes(bytes(content))
    with pytest.raises(o3l.errors.InputError, match=rf"{file.name}: is truncated or damaged"):
        read_volume(tmp_path / "a.zarr")


def test_a_zarr_folder_that_claims_more_than_it_holds_is_refused(tmp_path, voxels):
    write_zarr(tmp_path / "a.zarr", voxels)
    facts = tmp_path / "a.zarr" / "0" / "zarr.json"
    stated = json.loads(facts.read_text())
    stated["shape"] = [1, 10**6, 10**6, 10**6]
    facts.write_text(json.dumps(stated))
    with pytest.raises(o3l.errors.InputError, match="header lies"):
        read_volume(tmp_path / "a.zarr")


def test_a_png_that_claims_more_pixels_than_it_can_hold_is_refused(tmp_path):
    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    head = chunk(b"IHDR", struct.pack(">2I5B", 9000, 9000, 16, 0, 0, 0, 0))
    content = b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(bytes(100))) + chunk(b"IEND", b"")
    (tmp_path / "slice_1.png").write_bytes(content)
    with pytest.raises(o3l.errors.InputError, match="header lies"):
        read_volume(tmp_path, spacing=1)


def test_a_part_of_a_png_that_claims_more_than_there_is_is_refused(tmp_path):
    from PIL import Image

    Image.fromarray(np.arange(100, dtype=np.uint8).reshape(10, 10)).save(tmp_path / "slice_1.png")
    whole = bytearray((tmp_path / "slice_1.png").read_bytes())
    whole[whole.index(b"IDAT") - 4] = 0x7F
    (tmp_path / "slice_1.png").write_bytes(bytes(whole))
    with pytest.raises(o3l.errors.InputError, match=r"slice_1\.png.*truncated"):
        read_volume(tmp_path, spacing=1)


def test_a_zarr_folder_with_a_chunk_that_was_cut_off_is_refused(tmp_path, voxels):
    write_zarr(tmp_path / "v.zarr", voxels)
    chunk = max(file for file in (tmp_path / "v.zarr" / "0" / "c").rglob("*") if file.is_file())
    chunk.write_bytes(chunk.read_bytes()[:-5])
    with pytest.raises(o3l.errors.InputError, match=r"v\.zarr"):
        read_volume(tmp_path / "v.zarr")


def test_one_of_several_arrays_is_chosen_by_name(tmp_path, voxels):
    h5py = pytest.importorskip("h5py", reason="the extra `formats` is not installed")
    with h5py.File(tmp_path / "v.h5", "w") as file:
        file["low"], file["high"] = slices_first(voxels), slices_first(voxels) + 1
    np.savez(tmp_path / "v.npz", low=voxels, high=voxels + 1, log=np.arange(4))
    np.savez_compressed(tmp_path / "packed.npz", low=voxels, high=voxels + 1)
    for name in ("v.h5", "v.npz", "packed.npz"):
        with pytest.raises(o3l.errors.InputError, match=r"high, low.*dataset=NAME"):
            read_volume(tmp_path / name, spacing=1)
        read = read_volume(tmp_path / name, spacing=1, layout="dataset=high")
        assert np.array_equal(read.data, voxels + 1)
        with pytest.raises(o3l.errors.InputError, match="no array 'middle'"):
            read_volume(tmp_path / name, spacing=1, layout="dataset=middle")


@pytest.mark.parametrize("order", ["xyz", "zyx", "yxz"])
def test_the_order_of_axes_is_what_is_said(tmp_path, voxels, order):
    h5py = pytest.importorskip("h5py", reason="the extra `formats` is not installed")
    array = voxels.transpose(["xyz".index(axis) for axis in order])
    np.save(tmp_path / "v.npy", array)
    np.savez(tmp_path / "v.npz", array)
    array.tofile(tmp_path / "v.raw")
    with h5py.File(tmp_path / "v.h5", "w") as file:
        file["scan"] = array
    for name in ("v.npy", "v.npz", "v.h5", "v.raw"):
        bare = " shape=5x7x9 dtype=int16" if name == "v.raw" else ""
        read = read_volume(tmp_path / name, spacing=1, layout=f"axes={order}{bare}")
        assert np.array_equal(read.data, voxels)


@pytest.mark.parametrize("kind", ["uint8", "<u2", ">u2", ">f4", "float64"])
def test_bare_numbers_are_what_the_layout_says(tmp_path, voxels, kind):
    numbers = np.abs(voxels % 200).astype(kind)
    (tmp_path / "v.raw").write_bytes(b"a header of 25 bytes here" + slices_first(numbers).astype(kind).tobytes())
    read = read_volume(tmp_path / "v.raw", spacing=1, layout=f"shape=5x7x9 dtype={kind} offset=25")
    assert np.array_equal(read.data, numbers)


@pytest.mark.parametrize(
    ("layout", "says"),
    [
        (None, "give their layout"),
        ("shape=5x7x9", "give their layout"),
        ("shape=5x7x9 dtype=uint8", "check shape, dtype and offset"),
        ("shape=5x7x9 dtype=int16 offset=2", "check shape, dtype and offset"),
        ("shape=5x7 dtype=int16", "give three"),
        ("shape=5x7x0 dtype=int16", "give three"),
        ("shape=5xax9 dtype=int16", "give counts"),
        ("shape=5x7x9 dtype=object", "type of numbers"),
        ("shape=5x7x9 dtype=banana", "type of numbers"),
        ("shape=5x7x9 dtype=int16 axes=xyy", "letters x, y and z"),
        ("shape=5x7x9 dtype=int16 dataset=a", "leave it out"),
        ("shape=5x7x9 dtype=int16 shape=5x7x9", "cannot read 'shape="),
        ("5 7 9", "cannot read '5'"),
        ("shape=5x7x9 dtype=int16 offset=-2", "whole number of at least 0"),
    ],
)
def test_a_layout_that_cannot_be_is_refused(tmp_path, voxels, layout, says):
    voxels.tofile(tmp_path / "v.raw")
    with pytest.raises(o3l.errors.InputError, match=says):
        read_volume(tmp_path / "v.raw", spacing=1, layout=layout)


def test_a_layout_where_the_file_says_it_is_refused(tmp_path, voxels):
    o3l.write_volume(o3l.Volume(voxels.astype(np.float32), 1.0), tmp_path / "v.tif")
    with pytest.raises(o3l.errors.InputError, match=r"axes: .*says this itself"):
        read_volume(tmp_path / "v.tif", layout="axes=xyz")


def test_points_with_an_intensity_are_voxels_in_any_order(tmp_path, voxels):
    order = np.random.default_rng(0).permutation(voxels.size)
    places = (np.argwhere(np.ones(voxels.shape)) * SPACING + ORIGIN)[order].astype(np.float32)
    values = voxels.reshape(-1)[order].astype(np.float32)
    head = f"ply\nformat ascii 1.0\nelement vertex {len(places)}\n"
    head += "".join(f"property float {name}\n" for name in "xyzf") + "end_header\n"
    rows = [f"{x:.9g} {y:.9g} {z:.9g} {f:.9g}\n" for (x, y, z), f in zip(places, values, strict=True)]
    (tmp_path / "v.ply").write_text(head + "".join(rows))
    read = read_volume(tmp_path / "v.ply", unit="mm")
    assert np.array_equal(read.data, voxels)
    assert np.allclose(read.spacing, SPACING, rtol=1e-4)
    assert np.allclose(read.origin, ORIGIN, rtol=1e-5)
    # One voxel too few, one place twice, one place beside the lattice.
    for damaged in (rows[1:], [rows[1], *rows[1:]], ["0.1015 -0.2 0.3 7\n", *rows[1:]]):
        (tmp_path / "v.ply").write_text(head.replace(str(len(rows)), str(len(damaged))) + "".join(damaged))
        with pytest.raises(o3l.errors.InputError, match="lattice"):
            read_volume(tmp_path / "v.ply")
    (tmp_path / "v.ply").write_text((head + "".join(rows)).replace("property float f", "property float nx"))
    with pytest.raises(o3l.errors.InputError, match="intensity"):
        read_volume(tmp_path / "v.ply")


def test_png_slices_are_gray_values(tmp_path, voxels):
    from PIL import Image

    pages = (slices_first(voxels) + 3000).astype(np.uint16)
    for k, page in enumerate(pages):
        Image.fromarray(page).save(tmp_path / f"slice_{k}.png")
    read = read_volume(tmp_path, spacing=1)
    assert read.data.dtype == np.uint16
    assert np.array_equal(read.data, voxels + 3000)
    whole = (tmp_path / "slice_3.png").read_bytes()
    (tmp_path / "slice_3.png").write_bytes(whole[:60])
    with pytest.raises(o3l.errors.InputError, match=r"slice_3\.png"):
        read_volume(tmp_path, spacing=1)
    Image.fromarray(np.zeros((*pages.shape[1:], 3), np.uint8)).save(tmp_path / "slice_3.png")
    with pytest.raises(o3l.errors.InputError, match="color"):
        read_volume(tmp_path, spacing=1)


@pytest.mark.parametrize(
    ("name", "module", "extra"),
    [
        ("v.h5", "h5py", "formats"),
        ("v.zarr", "zarr", "formats"),
        ("v.dcm", "SimpleITK", "formats"),
    ],
)
def test_without_its_package_the_message_says_what_to_install(tmp_path, monkeypatch, name, module, extra):
    import sys

    (tmp_path / name).write_bytes(b"something")
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(o3l.errors.InputError, match=rf"pip install 'o3dleaf\[{extra}\]'"):
        read_volume(tmp_path / name)


NRRD = "NRRD0005\ntype: int16\ndimension: 3\nsizes: 9 7 5\nendian: little\nencoding: raw\n{}\n\n"
LATTICE = "space directions: (24,0,0) (0,24,0) (0,0,24)"


@pytest.mark.parametrize(
    ("lines", "unit"),
    [
        ("spacings: 24 24 24", None),
        ('spacings: 24 24 24\nunits: "um" "um" "um"', "um"),
        (f'space dimension: 3\n{LATTICE}\nspace units: "microns" "microns" "microns"', "um"),
        (f"space dimension: 3\n{LATTICE}", None),
        (f"space: left-posterior-superior\n{LATTICE}", "mm"),
        (f'space: left-posterior-superior\n{LATTICE}\nspace units: "um" "um" "um"', "um"),
    ],
)
def test_the_unit_of_an_nrrd_is_what_it_states(tmp_path, lines, unit):
    pytest.importorskip("SimpleITK", reason="the extra `formats` is not installed")
    voxels = np.arange(9 * 7 * 5, dtype="<i2")
    (tmp_path / "v.nrrd").write_bytes(NRRD.format(lines).encode() + voxels.tobytes())
    read = read_volume(tmp_path / "v.nrrd")
    assert read.unit == unit
    assert np.allclose(read.spacing, 24)


@pytest.mark.parametrize(("code", "unit", "length"), [(0, None, 24), (1, "mm", 24e3), (2, "mm", 24), (3, "mm", 24e-3)])
@pytest.mark.parametrize("packed", [False, True])
def test_the_unit_of_a_nifti_is_what_its_code_says(tmp_path, voxels, code, unit, length, packed):
    SimpleITK = pytest.importorskip("SimpleITK", reason="the extra `formats` is not installed")
    image = SimpleITK.GetImageFromArray(slices_first(voxels))
    image.SetSpacing((24.0, 24.0, 24.0))
    SimpleITK.WriteImage(image, tmp_path / "v.nii")
    head = bytearray((tmp_path / "v.nii").read_bytes())
    head[123] = code
    path = tmp_path / ("v.nii.gz" if packed else "v.nii")
    path.write_bytes(gzip.compress(bytes(head)) if packed else bytes(head))
    read = read_volume(path)
    assert read.unit == unit
    assert np.allclose(read.spacing, length)


def test_a_meta_image_is_in_millimeters_or_says_otherwise(tmp_path):
    pytest.importorskip("SimpleITK", reason="the extra `formats` is not installed")
    head = "ObjectType = Image\nNDims = 3\n{}DimSize = 9 7 5\nElementSpacing = 24 24 24\nElementType = MET_SHORT\n"
    for line, unit in (("", "mm"), ("DistanceUnits = um\n", "um"), ("DistanceUnits = ?\n", None)):
        text = head.format(line) + "ElementDataFile = LOCAL\n"
        (tmp_path / "v.mha").write_bytes(text.encode() + np.arange(315, dtype="<i2").tobytes())
        read = read_volume(tmp_path / "v.mha")
        assert (read.unit, read.spacing[0]) == (unit, 24.0)
