"""A volume on disk gives the voxels that are asked for, and reads no others."""

import tracemalloc

import numpy as np
import pytest
import tifffile

import o3dleaf as o3l
from o3dleaf.core.errors import InputError
from o3dleaf.leaf.ct import on_disk
from o3dleaf.leaf.ct.formats.counts import count_voxels
from o3dleaf.leaf.ct.on_disk import VolumeOnDisk
from o3dleaf.leaf.ct.volume import Volume
from o3dleaf.samples import wheat_ct

HUGE = (1600, 1700, 1600)
"""4.4 G voxels."""
PLACE = (400, 900, 700)
BOX = np.array([[410.0, 905, 698], [450, 950, 722]])
MEGABYTES = 64


@pytest.fixture(scope="module")
def patch():
    """Whole numbers of a patch of blade, (x, y, z)."""
    return np.clip(np.rint(50 + 600 * wheat_ct()[0].data), 0, 255).astype(np.uint8)


def place_of(patch):
    return tuple(slice(first, first + count) for first, count in zip(PLACE, patch.shape, strict=True))


def raw(patch, path):
    """Write bare numbers, of which only the patch takes room on the disk."""
    with path.open("wb") as file:
        file.truncate(int(np.prod(HUGE)))
    stored = np.memmap(path, np.uint8, "r+", shape=HUGE[::-1])
    stored[place_of(patch)[::-1]] = patch.T
    stored.flush()
    return path, {"layout": "shape={}x{}x{} dtype=uint8".format(*HUGE), "spacing": 1.0}


def zarr(patch, path):
    """Write a Zarr in which the chunks of the patch are the only ones."""
    zarr = pytest.importorskip("zarr")
    stored = zarr.create_array(str(path), shape=HUGE[::-1], chunks=(64, 64, 64), dtype="uint8")
    stored[place_of(patch)[::-1]] = patch.T
    return path, {"spacing": 1.0}


def hdf5(patch, path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        stored = file.create_dataset("scan", shape=HUGE[::-1], chunks=(64, 64, 64), dtype="uint8")
        stored[place_of(patch)[::-1]] = patch.T
    return path, {"spacing": 1.0}


@pytest.mark.parametrize(("write", "name"), [(raw, "ct.raw"), (zarr, "ct.zarr"), (hdf5, "ct.h5")])
def test_a_block_of_four_billion_voxels_is_read_alone(write, name, patch, tmp_path):
    path, how = write(patch, tmp_path / name)
    tracemalloc.start()
    volume = o3l.open_volume(path, **how)
    block = volume.crop(BOX)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert volume.shape == HUGE
    slices = tuple(slice(int(a), int(b) + 1) for a, b in (BOX - PLACE).clip(0).T)
    assert np.array_equal(block.data, np.pad(patch, ((0, 0), (0, 0), (2, 3)))[slices[0], slices[1]])
    assert np.array_equal(block.origin, BOX[0])
    assert peak < MEGABYTES * 2**20


@pytest.mark.parametrize(("write", "name"), [(zarr, "ct.zarr"), (hdf5, "ct.h5")])
def test_its_voxels_are_counted_though_few_are_stored(write, name, patch, tmp_path):
    assert count_voxels(write(patch, tmp_path / name)[0]) == np.prod(HUGE)


def test_a_block_of_it_is_thresholded_fitted_and_meshed(patch, tmp_path):
    path, how = raw(patch, tmp_path / "ct.raw")
    block = o3l.open_volume(path, **how).crop(BOX)
    level = block.threshold()
    field = o3l.PUInterpolant.fit_lattice(
        block.data, spacing=block.spacing, origin=block.origin, isovalue=level, rho=1e-5
    )
    mesh = o3l.extract_isosurface(field, 1.0)
    assert BOX[0, 2] < np.asarray(mesh.vertices)[:, 2].mean() < BOX[1, 2]


def test_the_level_of_a_sample_is_that_of_the_volume(patch, tmp_path):
    data = np.zeros((280, 210, 200), dtype=np.uint8)
    data[:, :, 90:110] = np.tile(patch, (4, 3, 1))
    np.save(tmp_path / "ct.npy", data)
    whole, level = Volume(data, 1.0).threshold(), o3l.open_volume(tmp_path / "ct.npy", spacing=1.0).threshold()
    assert abs(level - whole) < 0.02 * 600 * 0.2
    assert level == o3l.open_volume(tmp_path / "ct.npy", spacing=1.0).threshold()


def test_a_volume_that_shows_no_leaf_is_refused(tmp_path):
    data = np.zeros((90, 90, 90), dtype=np.uint8)
    data[:2, :2, :2] = 9
    np.save(tmp_path / "ct.npy", data)
    with pytest.raises(InputError, match="crop the volume"):
        o3l.open_volume(tmp_path / "ct.npy", spacing=1.0).threshold()


def test_a_leaf_that_no_sample_meets_is_looked_for_everywhere(patch, tmp_path, monkeypatch):
    """Its level is that of its own voxels, and a part of the file is in memory at a time."""
    data = np.zeros((400, 300, 200), dtype=np.uint8)
    data[301 : 301 + patch.shape[0], 7 : 7 + patch.shape[1], 60 : 60 + patch.shape[2]] = patch
    np.save(tmp_path / "ct.npy", data)
    monkeypatch.setattr(on_disk, "ROUNDS", 0)
    monkeypatch.setattr(on_disk, "PART", 1 << 20)
    volume = o3l.open_volume(tmp_path / "ct.npy", spacing=1.0)
    tracemalloc.start()
    level = volume.threshold()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert level == pytest.approx(Volume(patch, 1.0).threshold(), abs=0.02 * 600 * 0.2)
    assert peak < 0.5 * data.nbytes


@pytest.mark.parametrize("turned", [False, True])
def test_it_is_every_nth_voxel_that_is_not_zero(monkeypatch, turned):
    monkeypatch.setattr(on_disk, "PART", 700)
    monkeypatch.setattr(on_disk, "MAX_VOXELS", 100)
    data = np.arange(30 * 20 * 11, dtype=np.int32).reshape(30, 20, 11) % 7
    data *= np.arange(1, 6601, dtype=np.int32).reshape(30, 20, 11)
    stored = np.asfortranarray(data) if turned else data
    volume = VolumeOnDisk(stored, 1.0)
    order = np.concatenate([stored[part].ravel() for part in volume._parts()])
    assert np.array_equal(np.sort(order), np.sort(data.ravel()))
    found, there = volume._sample_of_all(), order[order != 0]
    assert 100 < len(found) <= 200
    stride = -(-len(there) // len(found))
    assert stride & (stride - 1) == 0
    assert np.array_equal(found, there[::stride])


def test_a_file_that_stays_open_is_closed(patch, tmp_path):
    path, how = hdf5(patch, tmp_path / "ct.h5")
    with o3l.open_volume(path, **how) as volume:
        volume.crop(BOX)
    with pytest.raises(InputError, match="damaged there"):
        volume.crop(BOX)
    path, how = raw(patch, tmp_path / "ct.raw")
    with o3l.open_volume(path, **how) as volume:
        pass
    assert volume.crop(BOX).data.any()


def test_damage_is_found_where_it_is(patch, tmp_path):
    path, how = zarr(patch, tmp_path / "ct.zarr")
    chunks = [file for file in path.rglob("*") if file.is_file() and file.name.isdigit()]
    max(chunks).write_bytes(b"nothing")
    volume = o3l.open_volume(path, **how)
    volume.crop(BOX)
    with pytest.raises(InputError, match="damaged there"):
        volume.crop([PLACE, np.add(PLACE, patch.shape)])


def test_slices_are_read_one_by_one(patch, tmp_path):
    for k, page in enumerate(patch.T):
        tifffile.imwrite(tmp_path / f"slice_{k}.tif", page)
    (tmp_path / "slice_19.tif").write_bytes(b"nothing")
    volume = o3l.open_volume(tmp_path, spacing=2.0)
    assert volume.shape == patch.shape
    block = volume.crop([[0, 10, 4], [60, 40, 30]])
    assert np.array_equal(block.data, patch[:31, 5:21, 2:16])
    with pytest.raises(InputError, match="slice_19"):
        volume.crop(volume.bounds)


def test_blocks_of_the_sample_lie_in_the_volume_and_in_one_chunk_each(monkeypatch):
    monkeypatch.setattr(VolumeOnDisk, "_sample_of_all", lambda _: np.empty(0))

    class Counted:
        def __init__(self, shape, chunks):
            self.shape, self.chunks, self.dtype, self.seen = shape, chunks, np.dtype("u1"), []

        def __getitem__(self, where):
            self.seen.append([(each.start, each.stop) for each in where])
            return np.zeros([each.stop - each.start for each in where], dtype=np.uint8)

    for shape, chunks in (((300, 400, 500), (64, 50, 128)), ((900, 800, 70), (900, 800, 1)), ((7, 5, 3), (4, 4, 4))):
        voxels = Counted(shape, chunks)
        with pytest.raises(InputError):
            o3l.VolumeOnDisk(voxels, 1.0).threshold()
        low, high = np.moveaxis(voxels.seen, -1, 0)
        assert (low >= 0).all()
        assert (high <= shape).all()
        assert np.array_equal(low // chunks, (high - 1) // chunks)


@pytest.mark.parametrize("axes", ["zyx", "xyz", "yzx"])
def test_what_is_read_by_parts_is_what_is_read_whole(axes, patch, tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "ct.h5", "w") as file:
        file.create_dataset("scan", data=patch, chunks=(16, 16, 16))
    how = {"spacing": (1, 2, 3), "layout": f"axes={axes}"}
    whole, opened = o3l.read_volume(tmp_path / "ct.h5", **how), o3l.open_volume(tmp_path / "ct.h5", **how)
    assert np.array_equal(opened.bounds, whole.bounds)
    part = [np.array(whole.bounds[0]) + 3, np.array(whole.bounds[0]) + (9, 30, 40)]
    assert np.array_equal(opened.crop(part).data, whole.crop(part).data)
    with pytest.raises(InputError, match="box in the volume"):
        opened.crop([[-50, -50, -50], [-40, -40, -40]])
