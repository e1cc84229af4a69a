"""Names of version 0.1, kept for one version: each works as the new one does, and says so."""

import warnings

RENAMED: dict[str, str] = {
    "Verdict": "CheckResult",
    "check_mesh": "check_report",
    "clean_labels": "clean_mesh",
    "extract_band": "extract_isosurface",
    "simplify_labels": "simplify_mesh",
}
"""Old public name to new public name."""


def new_name(old: str) -> str | None:
    """Return the new name of an old one, with a `DeprecationWarning` at the line that used it, or None."""
    new = RENAMED.get(old)
    if new is not None:
        warnings.warn(f"o3dleaf.{old} is now called {new}; the old name goes in version 0.3", DeprecationWarning, 3)
    return new
