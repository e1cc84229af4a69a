"""Figures from files: a scan and a CT volume, or a leaf that was saved, or the samples."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from o3dleaf.commands.leaf import read_patch
from o3dleaf.core.errors import InputError
from o3dleaf.core.journal import Journal
from o3dleaf.io.point_cloud import read_point_cloud
from o3dleaf.leaf.ct.volume import Volume
from o3dleaf.leaf.macro.blade import Blade
from o3dleaf.leaf.models import load
from o3dleaf.leaf.multiscale import MultiscaleLeaf
from o3dleaf.leaf.pipeline import BladeOptions, PatchOptions, create_blade, create_texture
from o3dleaf.leaf.texture.patches import PatchBlend
from o3dleaf.leaf.texture.tiling import TiledField
from o3dleaf.output.figures.draw import Drawn, check_request, draw_figures, make_folder
from o3dleaf.samples.files import MIDRIB, PATCH, SCAN, write_samples


@dataclass(frozen=True)
class FiguresJob:
    """What figures are asked for; the names are those of ``o3dleaf figures``.

    Attributes
    ----------
    output : Path
        The folder.
    scan, ct, model, midrib : Path, optional
        A scan, and a volume or a model of the micro-structure, from which the leaf is built; or the
        model of a leaf, which then needs the other files only for figures of what they hold. With neither
        a scan nor a model, the samples are drawn, written into `output` where they are not in `samples`.
    samples : Path
    scan_unit, ct_unit : str
    voxel_spacing : float, optional
    level, rho, period
        As in `PatchOptions`.
    formats : sequence of str
    only : sequence of str, optional
    """

    output: Path
    scan: Path | None = None
    ct: Path | None = None
    model: Path | None = None
    midrib: Path | None = None
    samples: Path = Path("data_samples")
    scan_unit: str = "mm"
    ct_unit: str | None = None
    voxel_spacing: float | None = None
    level: float | str = "valley"
    rho: Any = "gcv"
    period: Any = None
    formats: tuple[str, ...] = ("png", "pdf")
    only: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        """Refuse what can be refused before any work."""
        check_request(self.formats, self.only)
        if self.model is not None and self.midrib is not None:
            raise InputError("midrib, model: a saved leaf has its midrib; give one of them")
        if self.scan is None and self.model is None and (self.ct is not None or self.midrib is not None):
            raise InputError("scan: is missing; give one to the CT or midrib, or a model, or none for the samples")

    def run(self, journal: Journal) -> Drawn:
        """Read, build what was not saved, and draw."""
        make_folder(self.output)
        scan, ct, midrib = self.scan, self.ct, self.midrib
        if scan is None and self.model is None:
            folder = find_samples(self.samples, self.output)
            scan, ct, midrib = folder / SCAN, folder / PATCH, folder / MIDRIB
        with journal.stage("read"):
            points = None if scan is None else read_point_cloud(scan)
            patch = None if ct is None else read_patch(ct, self.voxel_spacing, self.ct_unit)
            axis = None if midrib is None else read_point_cloud(midrib, least=2)
        leaf = self.read_leaf(self.model) if self.model is not None else self.build(points, patch, axis, journal)
        volume = patch if isinstance(patch, Volume) else None
        wanted: dict[str, Any] = {"level": self.level, "formats": self.formats, "only": self.only}
        with journal:
            return draw_figures(leaf, self.output, scan=points, volume=volume, **wanted)

    def build(
        self, points: Any, patch: Volume | TiledField | PatchBlend | None, midrib: Any, journal: Journal
    ) -> Blade | MultiscaleLeaf:
        """Build the leaf, or the blade alone where there is no micro-structure."""
        blade = create_blade(points, midrib, unit=self.scan_unit, options=BladeOptions(), journal=journal)
        if patch is None:
            return blade
        micro = PatchOptions(self.level, self.rho, self.period)
        texture = create_texture(patch, options=micro, journal=journal) if isinstance(patch, Volume) else patch
        return MultiscaleLeaf(texture, blade.frame, blade.height_map, blade.outline)

    @staticmethod
    def read_leaf(path: Path) -> Blade | MultiscaleLeaf:
        """Return the leaf or blade of a model file, or raise `InputError`."""
        found = load(path)
        if not isinstance(found, Blade | MultiscaleLeaf):
            raise InputError(f"{path}: holds a {type(found).__name__}, no leaf; give a model that `leaf --model` wrote")
        return found


def find_samples(samples: Path, output: Path) -> Path:
    """Return the folder of the samples, made in `output` where they are not in `samples`."""
    if all((samples / name).is_file() for name in (SCAN, MIDRIB, PATCH)):
        return samples
    made = output / samples.name
    write_samples(made)
    return made
