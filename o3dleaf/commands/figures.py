"""`o3dleaf figures`: figures of a scan and a CT volume, of a leaf that was saved, or of the samples."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from o3dleaf.commands.patch import CtOptions
from o3dleaf.commands.sample import SampleOption
from o3dleaf.core.errors import InputError
from o3dleaf.core.jobs.job import LongJob
from o3dleaf.core.jobs.option import argument, option
from o3dleaf.core.jobs.shared import ScanOptions
from o3dleaf.core.jobs.words import words_of
from o3dleaf.core.journal import stage

if TYPE_CHECKING:
    from o3dleaf.core.resources.needs import Need
    from o3dleaf.leaf.blade.blade import Blade
    from o3dleaf.leaf.multiscale import MultiscaleLeaf
    from o3dleaf.output.figures.draw import Drawn


@dataclass(frozen=True)
class FiguresJob(SampleOption, ScanOptions, CtOptions, LongJob):
    """Draw figures like the paper's: scan, flattened scan, height map, histogram, tiles, cross-section, whole leaf."""

    scan: Path | None = argument("Scan of one leaf; the samples, if there is no --model.", default=None, reads=True)
    output: Path = option(Path("figures"), "Folder to write into.", "--output", "-o")
    ct: Path | None = option(None, "Micro-CT volume, or a model that `patch` made.", reads=True)
    model: Path | None = option(None, "A leaf that `leaf --model` wrote, instead of building it.", reads=True)
    formats: str = option("png,pdf", "File formats: png, pdf, svg, jpg, separated by commas.")
    only: str | None = option(None, "Names of figures, 'scan,tile'; all by default.")
    # The paper's tiles are neither mirrored nor shifted, so these two are no options here.
    flip: str | None = None
    shift: float = 0.0

    @property
    def volume(self) -> bool:
        """Whether the leaf is built of a volume, given or of the samples."""
        return self.volume_of(self.ct) is not None or (self.scan is None and self.model is None)

    @property
    def saved_leaf(self) -> bool:
        """Whether a leaf is drawn that was built before (--model)."""
        return self.model is not None

    def check(self) -> None:
        """Refuse figures that there are not, and files that do not go together."""
        from o3dleaf.output.figures.draw import check_request

        super().check()
        check_request(*self.wanted)
        if self.scan is None and self.model is None and (self.ct is not None or self.midrib is not None):
            raise InputError(
                "scan: is missing; give one with the CT volume or midrib, or a model, or no file to draw the samples"
            )

    def estimate(self) -> "list[Need]":
        """Return what scan and volume take, or the samples; a model that was saved is drawn as it is read."""
        from o3dleaf.core.resources.measured import SAMPLES
        from o3dleaf.core.resources.needs import need_of
        from o3dleaf.io.clouds.counts import count_points
        from o3dleaf.leaf.pipeline import need_for_blade

        if self.scan is None:
            return [] if self.model is not None else [need_of(SAMPLES, "samples", "close other programs")]
        return [*(self.need_for(self.ct) if self.ct else []), need_for_blade(count_points(self.scan))]

    @property
    def wanted(self) -> tuple[list[str], list[str] | None]:
        """The formats and the figures that are requested."""
        return words_of(self.formats), None if self.only is None else words_of(self.only)

    def work(self) -> "Drawn":
        """Read, build what was not saved, and draw."""
        from o3dleaf.core.atomic_files import make_folder
        from o3dleaf.io.point_cloud import read_point_cloud
        from o3dleaf.leaf.ct.volume import Volume
        from o3dleaf.leaf.saved.models import load_leaf
        from o3dleaf.output.figures.draw import draw_figures

        make_folder(self.output)
        scan, midrib, ct = self.scan, self.midrib, self.ct
        if scan is None and self.model is None:
            scan, midrib, ct = self.find_samples(self.output)
        with stage("read"):
            points = None if scan is None else read_point_cloud(scan)
            patch = None if ct is None else self.read_patch(ct)
            control = None if midrib is None else read_point_cloud(midrib, least=2)
        leaf = self.build(points, patch, control) if self.model is None else load_leaf(self.model)
        volume = patch if isinstance(patch, Volume) else None
        formats, only = self.wanted
        return draw_figures(leaf, self.output, scan=points, volume=volume, level=self.level, formats=formats, only=only)

    def build(self, points: Any, patch: Any, control: Any) -> "Blade | MultiscaleLeaf":
        """Build the leaf, or the blade alone where there is no micro-structure."""
        from o3dleaf.leaf.options import BladeOptions
        from o3dleaf.leaf.pipeline import create_blade, create_multiscale_leaf

        paper = BladeOptions(frame="paper")
        if patch is None:
            return create_blade(points, control, unit=self.scan_unit, options=paper)
        return create_multiscale_leaf(points, patch, control, unit=self.scan_unit, blade=paper, texture=self)

    def line(self, summary: "Drawn") -> str:
        """Return how many files there are."""
        return f"{self.output}: {len(summary.paths) - 1} files and {summary.paths[-1].name}"
