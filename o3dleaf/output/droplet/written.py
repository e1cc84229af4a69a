"""A case that was written: what its files say."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from o3dleaf.core.errors import InputError
from o3dleaf.output.droplet.units import TIME

SETTINGS = "droplet.json"
"""What a case was made of; a folder without it is none of ours."""
RESULTS = "**/postProcessing"
"""What a run leaves."""


def read_settings(folder: Path) -> dict[str, Any]:
    """Return the settings of a case, or raise `InputError` if the folder is none."""
    try:
        content = json.loads((folder / SETTINGS).read_text(encoding="utf-8"))
    except (OSError, ValueError) as cause:
        raise InputError(
            f"{folder}: is no droplet case ({SETTINGS} is missing or broken); make one with "
            "o3dleaf export MODEL --for droplet --at ALONG ACROSS -o CASE"
        ) from cause
    return dict(content)


@dataclass(frozen=True, eq=False)
class WrittenCase:
    """A case that was written, or one of several in a folder.

    Attributes
    ----------
    folder : Path
    settings : mapping
    """

    folder: Path
    settings: Mapping[str, Any]

    @property
    def duration(self) -> float:
        """Seconds that are simulated: as the file of numbers says, which may have been changed since."""
        return self.constant("endTime") * TIME

    @property
    def cells(self) -> float:
        """Cells of the box, those in the leaf too."""
        return self.constant("xCells") * self.constant("yCells") * self.constant("zCells")

    @property
    def steps(self) -> float:
        """Steps of a run, at least: on a leaf they are shorter."""
        return self.constant("endTime") / self.constant("maxDeltaT")

    def constant(self, name: str) -> float:
        """Return a number of the file `constants`, in the solver's units."""
        try:
            text = (self.folder / "constants").read_text(encoding="utf-8")
        except (OSError, ValueError) as cause:
            raise InputError(f"{self.folder / 'constants'}: cannot be read; make the case anew") from cause
        found = re.search(rf"^{name}\s+(\S+);", text, re.MULTILINE)
        try:
            return float(found[1]) if found else float("nan")
        except ValueError as cause:
            raise InputError(f"{self.folder / 'constants'}: {name} is {found and found[1]!r}; give a number") from cause


def find_cases(folder: Path) -> list[WrittenCase]:
    """Return the cases in a folder: the one that it is, or those of several landing places."""
    settings = read_settings(folder)
    parts = [folder / str(name) for name in settings.get("cases", ())]
    return [WrittenCase(part, read_settings(part)) for part in parts] or [WrittenCase(folder, settings)]
