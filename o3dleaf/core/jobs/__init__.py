"""A job on files: a frozen dataclass whose fields are the options of its command.

::

    @dataclass(frozen=True)
    class PaintJob(LongJob):
        '''Paint a mesh.'''

        mesh: Path = argument("Mesh to paint.", reads=True)
        output: Path = output("o3dleaf.io.triangle_mesh:SUFFIXES")
        color: str = option("green", "Color of the paint.", choices=("green", "brown"))
        width: Positive | None = option(None, "Width of the brush; by default that of the mesh", unit="the mesh's unit")
        stripes: Path | None = option(None, "Where to paint them.", reads=True)
        angle: Finite = option(0.0, "Of the stripes", unit="degrees", needs=("stripes",))

        def work(self) -> int: ...

The line of a field is all that there is to an option: `o3dleaf.commands.cli` makes the command line of it, `Job.check`
refuses what it does not allow, what its annotation does not, and what cannot act as the others are; nothing hands it on
by name. `Job.estimate` says what it will need of memory, from its options and the heads of its files; more than there
is is refused before the work too. Nothing heavy is imported here, nor in a module that declares a job: ``o3dleaf
--help`` imports them all. Tables of suffixes and choices are named as ``module:NAME``.

`option`  the options: fields, with what the command line says of them
`shared`  options that several jobs have
`job`     the job itself: what it refuses, what it reads and writes, and what it says
`words`   texts of a command line, as numbers
"""
