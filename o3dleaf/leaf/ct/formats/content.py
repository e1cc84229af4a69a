"""The kind of a file, by the bytes that it begins with, whatever its name."""

from pathlib import Path

SIGNATURES = (
    (0, b"ply", "PLY", ".ply"),
    (0, b"# .PCD", "PCD", ".pcd"),
    (0, b"LASF", "LAS", ".las"),
    (0, b"ASTM-E57", "E57", ".e57"),
    (0, b"OFF", "OFF", ".off"),
    (0, b"solid ", "STL", ".stl"),
    (0, b"II*\0", "TIFF", ".tif"),
    (0, b"MM\0*", "TIFF", ".tif"),
    (0, b"II+\0", "BigTIFF", ".tif"),
    (0, b"NRRD", "NRRD", ".nrrd"),
    (0, b"ObjectType", "MetaImage", ".mha"),
    (344, b"n+1\0", "NIfTI", ".nii"),
    (128, b"DICM", "DICOM", ".dcm"),
    (0, b"CTDATA-HEADER_V1", "Scanco's ISQ", ".isq"),
    (0, b"AIMDATA_V030", "Scanco's AIM", ".aim"),
    (0, b"\x89HDF", "HDF5", ".h5"),
    (0, b"\x93NUMPY", "NumPy's NPY", ".npy"),
    (0, b"\x89PNG", "PNG, one picture", None),
    (0, b"\xff\xd8\xff", "JPEG, one picture", None),
    (0, b"PK\x03\x04", "a ZIP archive: unpack it", None),
    (0, b"\x1f\x8b", "packed by gzip: unpack it", None),
    (0, b"# AmiraMesh", "an Amira mesh: export a TIFF stack, or NRRD", None),
    (0, b"# Avizo", "an Avizo mesh: export a TIFF stack, or NRRD", None),
    (0, b"%PDF", "PDF", None),
)
"""Where in a file which bytes stand, in which format, and the suffix by which we read it."""


VG_STUDIO = {
    ".vol": "bare numbers: give them the suffix .raw, and the layout that the .vgi beside them states",
    ".vgi": "the description of a .vol: give that the suffix .raw, and the layout that this one states",
}
"""What VGStudio writes, which has no bytes to be known by."""


def content_hint(path: Path) -> str:
    """Return the end of a message on a file of an unknown kind: what its content looks like, "" if like nothing."""
    try:
        with path.open("rb") as file:
            head = file.read(512)
    except OSError:
        return ""
    for place, signature, name, suffix in SIGNATURES:
        if head[place:].startswith(signature):
            return f"; its content looks like {name}" + (f", give it the suffix {suffix}" if suffix else "")
    studio = VG_STUDIO.get(path.suffix.lower())
    return f"; its name looks like {studio}" if studio else ""
