"""`o3dleaf patch`: a micro-CT volume fitted once, and the options of all commands that read one."""

from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from o3dleaf.core.arguments.kinds import Positive, Unit
from o3dleaf.core.errors import InputError, UnitError
from o3dleaf.core.jobs.job import Job, LongJob
from o3dleaf.core.jobs.option import argument, option, output, table
from o3dleaf.core.jobs.shared import ClusterOptions, ResumeOption
from o3dleaf.core.jobs.words import number_or_word, words_of
from o3dleaf.core.journal import stage
from o3dleaf.leaf.options import OF_VOLUME, TextureOptions

if TYPE_CHECKING:
    from o3dleaf.core.processes.spread import Spread
    from o3dleaf.core.resources.needs import Need
    from o3dleaf.core.resume.parts import Parts
    from o3dleaf.leaf.ct.volume import Volume
    from o3dleaf.leaf.texture.patches import PatchBlend
    from o3dleaf.leaf.texture.tiling import TiledField
    from o3dleaf.leaf.texture.wang.wang_field import WangField

MODEL = "o3dleaf.io.models.model_file:SUFFIX"
"""Suffix of model files."""
LAYOUT_HELP = (
    "What the file of a volume does not say of its voxels, such as 'dataset=scan/raw axes=zyx' (axes of the array, the "
    "slowest first), or of bare numbers 'shape=700x700x160 dtype=uint16 offset=512'."
)
CROP_HELP = "Read only this box of the volume, 'X0 Y0 Z0 X1 Y1 Z1'"


def parse_box(text: str) -> Any:
    """Return the two corners in a text of six numbers, or the text, which is refused later."""
    values = [number_or_word(word) for word in words_of(text)]
    return [values[:3], values[3:]] if len(values) == 6 else text


def require_box(box: Any, name: str) -> None:
    """Raise `InputError` for what is neither None nor a box."""
    from o3dleaf.core.checks.coordinates import as_bounds

    if isinstance(box, str):
        raise InputError(f"{name}: is {box!r}; give six numbers, 'X0 Y0 Z0 X1 Y1 Z1'")
    if box is not None:
        as_bounds(box, 3, name)


@dataclass(frozen=True, kw_only=True)
class CtOptions(TextureOptions):
    """Options for reading a micro-CT volume and for the texture made of it."""

    HEADING: ClassVar = "Micro-CT volume"

    ct_unit: Unit | None = option(
        None, "Unit of the volume's coordinates; lengths stated in its file are converted.", **OF_VOLUME
    )
    voxel_spacing: Positive | None = option(
        None, "Edge of a voxel (needed if the file does not state it)", unit="ct-unit", **OF_VOLUME
    )
    ct_layout: str | None = option(None, LAYOUT_HELP, **OF_VOLUME)
    ct_crop: Any = option(None, CROP_HELP, kind=str, parse=parse_box, unit="ct-unit", **OF_VOLUME)
    remove_drift: bool = option(
        False, "Give air and leaf the same intensities in all slices, which follow one another along z.", **OF_VOLUME
    )
    remove_rings: bool = option(False, "Remove rings, and cupping, around the scanner's axis along z.", **OF_VOLUME)
    remove_bend: bool = option(
        False, "Straighten a blade that bends in the volume, which every tile would repeat.", **OF_VOLUME
    )
    ring_axis: tuple[float, float] | None = option(
        None,
        "X Y of the rings' axis (the middle of the file's slices, by default)",
        unit="ct-unit",
        needs=("remove_rings",),
    )

    @staticmethod
    def volume_of(path: Path | None) -> Path | None:
        """Return the file that a micro-structure is made of, if it is no model, which is one already."""
        return path if path is not None and path.suffix.lower() not in table(MODEL) else None

    def check_texture(self) -> None:
        """Refuse what the texture of no volume can have."""
        from o3dleaf.core.checks.scalars import as_number, require_choice
        from o3dleaf.fitting.rbf.kernels import polyharmonic
        from o3dleaf.fitting.rbf.smoothing import as_smoothing
        from o3dleaf.leaf.ct.threshold import METHODS
        from o3dleaf.leaf.texture.tile_crop import require_tiling

        if isinstance(self.level, str):
            require_choice(self.level, METHODS, "level")
        else:
            as_number(self.level, "level")
        require_box(self.ct_crop, "ct-crop")
        as_smoothing(polyharmonic(2, 3), None, self.rho)
        require_tiling(self.period, self.flip, self.shift)
        self.check_tiles()

    def need_for(self, path: Path) -> "list[Need]":
        """Return what the volume of a file takes, to be read and to be fitted; nothing for the texture of a model."""
        from o3dleaf.leaf.ct.formats.counts import count_cropped, count_voxels
        from o3dleaf.leaf.pipeline import need_for_texture

        if path.suffix.lower() in table(MODEL):
            return []
        crop = self.ct_crop
        voxels = count_voxels(path) if crop is None else count_cropped(path, crop, **self.lattice)
        return [need_for_texture(voxels, corrected=self.is_corrected)]

    def read_volume(self, path: Path) -> "Volume":
        """Return the volume of a file, or of the part of it that is wanted, corrected as was asked for."""
        from o3dleaf.leaf.ct.corrections.bend import remove_bend
        from o3dleaf.leaf.ct.corrections.drift import remove_drift
        from o3dleaf.leaf.ct.corrections.rings import middle, remove_rings
        from o3dleaf.leaf.ct.formats.read import open_volume, read_volume

        if self.ct_crop is None:
            volume = read_volume(path, **self.lattice)
            axis = middle(volume)
        else:
            opened = open_volume(path, **self.lattice)
            volume, axis = opened.crop(self.ct_crop), middle(opened)
        if volume.unit is None:
            raise UnitError(f"{path}: does not state the unit of its lengths; give ct-unit")
        if self.remove_drift:
            volume = remove_drift(volume)
        if self.remove_rings:
            volume = remove_rings(volume, self.ring_axis or axis)
        return remove_bend(volume, self.level) if self.remove_bend else volume

    @property
    def is_corrected(self) -> bool:
        """Whether the voxels that are fitted are others than those of the file."""
        return self.remove_drift or self.remove_rings or self.remove_bend

    @property
    def lattice(self) -> dict[str, Any]:
        """What was said of the lattice, where the file does not say it."""
        return {"spacing": self.voxel_spacing, "unit": self.ct_unit, "layout": self.ct_layout}

    def read_patch(self, path: Path) -> "Volume | TiledField | PatchBlend | WangField":
        """Return the volume of a file, or the texture of a model file."""
        from o3dleaf.leaf.saved.models import load_texture

        return load_texture(path) if path.suffix.lower() in table(MODEL) else self.read_volume(path)


def resumed(output: Path, job: Job) -> "AbstractContextManager[Parts]":
    """Return the context in which a job keeps its finished parts beside the output, and takes those there are."""
    from o3dleaf.core.resume.parts import key_of, resuming
    from o3dleaf.leaf.saved.models import load

    return resuming(output, key_of(job.inputs(), job.settings), load)


@dataclass(frozen=True, kw_only=True)
class BlockOption:
    """One period of the micro-structure as a solid of its own."""

    tile_solid: Path | None = option(
        None,
        "Also write one flat period as a closed block; opposite sides match.",
        writes="o3dleaf.io.triangle_mesh:SUFFIXES",
        needs=("ct",),
    )


@dataclass(frozen=True)
class PatchJob(CtOptions, BlockOption, ResumeOption, ClusterOptions, LongJob):
    """Fit the micro-structure of a volume once, into a model file that `leaf --ct` takes."""

    volume: Path = argument(
        "Micro-CT volume: TIFF, folder of slices, DICOM, ISQ, NRRD, HDF5, OME-Zarr, NPY, raw, ...", reads=True
    )
    output: Path = output(MODEL)
    spacing: Positive | None = option(
        None, "Mesh spacing of the block of --tile-solid", unit="ct-unit", needs=("tile_solid",)
    )

    def check(self) -> None:
        """Refuse a block without a step, and a texture that cannot be."""
        super().check()
        self.check_texture()
        if self.tile_solid is not None and self.spacing is None:
            raise InputError("spacing: is missing, and the block of tile-solid is meshed at it; give it")
        if self.is_spread and self.is_corrected:
            raise InputError(
                "workers, scheduler: read the voxels of the file as they are; leave out remove-drift, remove-rings and "
                "remove-bend, or write the corrected volume first (write_volume)"
            )

    def estimate(self) -> "list[Need]":
        """Return what the volume takes, to be read and to be fitted."""
        return self.need_for(self.volume)

    def work(self) -> "TiledField | WangField":
        """Write the model and the block, and return the texture."""
        from o3dleaf.core.processes.spread import spreading

        with resumed(self.output, self) if self.resume else nullcontext():
            if not self.is_spread:
                return self.build()
            with spreading(self.workers, self.scheduler) as spread:
                return self.build(spread)

    def build(self, spread: "Spread | None" = None) -> "TiledField | WangField":
        """Write the model and the block, by workers that read them from their files, and return the texture."""
        from o3dleaf.io.models.model_draft import model_draft
        from o3dleaf.leaf.ct.voxel_file import VoxelFile
        from o3dleaf.leaf.meshing import write_flat_tile
        from o3dleaf.leaf.pipeline import create_texture
        from o3dleaf.leaf.saved.models import SavedTexture

        with stage("read"):
            volume = self.read_volume(self.volume)
        if spread is not None:
            spread.know(volume.data, VoxelFile.of(self.volume, volume.shape, self.ct_crop, **self.lattice))
        with model_draft(self.output):
            texture = create_texture(volume, options=self)
            with stage("write model"):
                texture.save(self.output)
        if self.tile_solid is not None and self.spacing is not None:
            if spread is not None:
                spread.know(texture, SavedTexture.of(self.output))
            with stage("write tile"):
                write_flat_tile(texture, 1.0, self.spacing, self.tile_solid)
        return texture

    def line(self, summary: "TiledField | WangField") -> str:
        """Return the size of the tile, or of Wang tiles, and how well they match."""
        size, energy = getattr(summary, "tile", summary.period).tolist(), summary.seam_energy()
        what = "16 Wang tiles of" if self.wang else "tile"
        return f"{self.output}: {what} {size} {summary.unit or ''}, seam energy {energy.total:.3g}"
