"""Whole files of every format, damaged: they are read or refused in one line, and nothing else happens.

`scripts/fuzz.py` does the same with millions of bytes, in processes of their own.
"""

import importlib
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from o3dleaf.core.errors import InputError, O3DLeafError

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
NAMES = (
    "model", "ply-points", "ply-mesh", "obj", "off", "stl", "pcd", "columns", "text", "las", "e57", "tiff", "npy",
    "itk", "dicom", "packed-dicom", "isq", "aim", "hdf5", "zarr", "npz", "png", "lattice-points",
)  # fmt: skip
EDITS = st.lists(st.tuples(*[st.integers(0, (1 << 32) - 1)] * 3), min_size=1, max_size=4)
EXTRAS = {
    "las": "laspy", "e57": "pye57", "itk": "SimpleITK", "dicom": "SimpleITK", "packed-dicom": "SimpleITK",
    "aim": "py_aimio", "hdf5": "h5py", "zarr": "zarr",
}  # fmt: skip
EXAMPLES = {"packed-dicom": 50, "zarr": 40, "dicom": 60}
"""Of those that take long: packed DICOM is unpacked in a process of its own. Of others 100."""
SHARE = 0.25
"""Of the examples that are tried without `--slow`: the others are more of the same."""
SLOW = [pytest.param(name, marks=pytest.mark.slow) if name == "packed-dicom" else name for name in NAMES]


@pytest.fixture(scope="module")
def damaged(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(SCRIPTS))
        module = importlib.import_module("damaged")

    @cache
    def whole_files(name):
        folder = tmp_path_factory.mktemp(name)
        module.READERS[name].make(folder)
        return folder, [(file.name, file.read_bytes()) for file in sorted(folder.iterdir()) if file.suffix != ".raw"]

    return module, whole_files


def test_all_readers_are_fuzzed(damaged):
    module, _ = damaged
    assert list(module.READERS) == list(NAMES)


@pytest.mark.parametrize("name", SLOW)
def test_a_damaged_file_is_read_or_refused_in_one_line(damaged, pytestconfig, name):
    if name in EXTRAS:
        pytest.importorskip(EXTRAS[name])
    module, whole_files = damaged
    reader, (folder, files) = module.READERS[name], whole_files(name)

    share = 1.0 if pytestconfig.option.slow else SHARE

    @settings(max_examples=round(share * EXAMPLES.get(name, 100)))
    @given(which=st.integers(0, len(files) - 1), other=st.integers(0, len(files) - 1), edits=EDITS)
    def check(which, other, edits):
        file, content = files[which]
        (folder / file).unlink()  # some file systems wait for the disk where a file is cut and written anew
        (folder / file).write_bytes(reader.damage(content, edits, files[other][1]))
        try:
            arrays = reader.read(folder / file)
        except O3DLeafError as error:
            assert "\n" not in str(error)  # noqa: PT017 - most files are refused
            return
        again = reader.read(folder / file)
        assert all(a.tobytes() == b.tobytes() for a, b in zip(arrays, again, strict=True))

    check()


@pytest.mark.parametrize("name", SLOW)
def test_a_whole_file_is_read(damaged, name):
    """What is refused would otherwise be no sign of anything."""
    if name in EXTRAS:
        pytest.importorskip(EXTRAS[name])
    module, whole_files = damaged
    folder, files = whole_files(name)
    for file, content in files:
        (folder / file).write_bytes(content)
        assert module.READERS[name].read(folder / file)


def test_a_material_is_not_looked_for(tmp_path):
    """An OBJ may name any file, a device among them, that hangs whoever reads it."""
    import o3dleaf as o3l

    (tmp_path / "a.mtl").write_text("newmtl a\nmap_Kd /dev/zero\n")
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert len(o3l.read_mesh(tmp_path / "a.obj").mesh.triangles) == 1


@pytest.mark.parametrize("where", ["/dev/zero", "../secret.raw", "list", "LIST", "a%d.raw 1 9 1", "pattern.%03d"])
def test_a_header_of_voxels_leads_nowhere_else(tmp_path, where):
    pytest.importorskip("SimpleITK")
    from o3dleaf import read_volume

    folder = tmp_path / "here"
    folder.mkdir()
    (tmp_path / "secret.raw").write_bytes(bytes(range(120)))
    (folder / "a.mhd").write_text(f"NDims = 3\nDimSize = 6 5 4\nElementType = MET_UCHAR\nElementDataFile = {where}\n")
    (folder / "a.nhdr").write_text(
        f"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 6 5 4\nencoding: raw\ndata file: {where}\n"
    )
    for name in ("a.mhd", "a.nhdr"):
        with pytest.raises(InputError, match=r"beside it|which is not there"):
            read_volume(folder / name, spacing=1.0)


def test_an_ome_tiff_leads_to_no_other_file(tmp_path):
    import tifffile

    from o3dleaf import read_volume

    voxels = np.arange(120, dtype=np.uint8).reshape(4, 5, 6)
    tifffile.imwrite(tmp_path / "secret.ome.tif", voxels, ome=True, metadata={"axes": "ZYX"})
    file = tmp_path / "a.ome.tif"
    tifffile.imwrite(file, voxels, ome=True, metadata={"axes": "ZYX", "UUID": "urn:uuid:1"})
    text = tifffile.TiffFile(file).ome_metadata
    with tifffile.TiffFile(file, mode="r+b") as tiff:
        named = '<TiffData IFD="0" FirstZ="0"><UUID FileName="{}">urn:uuid:{}</UUID></TiffData>'
        both = named.format("a.ome.tif", 1) + named.format(tmp_path / "secret.ome.tif", 2)
        tiff.pages.first.tags["ImageDescription"].overwrite(text.replace("</Pixels>", both + "</Pixels>"))
    with pytest.raises(InputError, match="one file"):
        read_volume(file, spacing=1.0, unit="um")


PLY = "ply\nformat binary_little_endian 1.0\nelement vertex 4\n"
PLY += "".join(f"property float {name}\n" for name in "xyz") + "end_header\n"
PCD = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 4\nHEIGHT 1\nPOINTS 4\nDATA binary\n"


@pytest.mark.parametrize(("name", "header"), [("a.ply", PLY), ("a.pcd", PCD)], ids=["ply", "pcd"])
def test_a_nan_that_signals_is_refused_like_any_other(tmp_path, name, header):
    """Damage made one: such a number tells whoever casts it, which is no fault of a file that is read."""
    import o3dleaf as o3l

    points = np.arange(12, dtype=np.float32).reshape(4, 3)
    points.view(np.uint32)[1, 2] = 0x7FA00000
    (tmp_path / name).write_bytes(header.encode() + points.tobytes())
    with pytest.raises(InputError, match="1 values are NaN"):
        o3l.read_point_cloud(tmp_path / name)


def test_a_png_of_more_pixels_than_pillow_is_used_to_is_read(monkeypatch, tmp_path):
    """A slice of 90 million is nothing unusual, and no attack."""
    from PIL import Image

    from o3dleaf import read_volume

    pages = np.arange(1200, dtype=np.uint8).reshape(2, 20, 30)
    for page, name in zip(pages, ("s1.png", "s2.png"), strict=True):
        Image.fromarray(page).save(tmp_path / name)
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 100)
    assert sorted(read_volume(tmp_path, spacing=1.0, unit="um").shape) == [2, 20, 30]
