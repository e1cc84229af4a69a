"""o3dleaf: a laser scan and a micro-CT volume of a leaf, made into one smooth, multi-scale surface.

The names below are loaded when they are first used, so that `import o3dleaf` costs nothing; they
stand in the order of the story in the stub beside this file, `__init__.pyi`.

`__main__`    the program, under a guard against interrupts
`core`        errors, checks, units, fields, threads, and the doors to Open3D and the disk
`io`          point clouds, meshes and models from and to files
`fitting`     scattered data to a function: radial basis functions and their partition of unity
`surface`     any cloud, any field, any mesh
`leaf`        the blade of a scan, the micro-structure of a CT, and their fusion
`samples`     synthetic leaves and solids with known truth
`output`      files for the next program, pictures, reports, figures
`commands`    the command line
`errors`      every error and warning
`deprecated`  names of version 0.1

Examples
--------
>>> import open3d as o3d, o3dleaf as o3l  # doctest: +SKIP
>>> leaf = o3l.create_multiscale_leaf(o3d.io.read_point_cloud("scan.ply"), o3l.read_volume("ct.tif"))  # doctest: +SKIP
>>> leaf.write_mesh("leaf.ply", spacing=0.024)  # doctest: +SKIP
"""


def __getattr__(name: str) -> object:
    if name == "__version__":
        from importlib.metadata import version  # noqa: PLC0415 - reading metadata costs as much as all the rest here

        return version("o3dleaf")
    load, _, names = _stub()
    if name == "__all__":
        return names
    if name not in names:
        from o3dleaf.deprecated import old_name  # noqa: PLC0415 - nobody else needs it

        thing = old_name(name)
        if thing is not None:
            return thing
    return load(name)


def __dir__() -> list[str]:
    return _stub()[1]()


def _stub():  # type: ignore[no-untyped-def]  # noqa: ANN202 - nothing is imported for its type
    """Return what loads a name, what lists them, and all names, read from the stub when the first is asked for.

    The program is on its way through here when it cannot handle an interrupt yet: that takes no longer than it must.
    """
    global _known  # noqa: PLW0603 - once
    if _known is None:
        import lazy_loader  # noqa: PLC0415 - with what it parses the stub by it takes longer than all else here

        _known = lazy_loader.attach_stub(__name__, __file__)
    return _known


_known = None
