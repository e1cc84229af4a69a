"""Arguments of public functions are checked against their annotations, in this one place.

::

    @checked
    def thin(mesh: MeshLike, step: float, *, unit: str | None = None) -> Mesh: ...

    thin(mesh, "3")     # InputError: step: is '3'; give a number

What an annotation tells is checked: numbers, whole numbers, truths, words, paths, pairs of numbers, functions, objects
of a class; and ranges, where they are annotated (`Positive`). Arrays, clouds and meshes come in too many forms for
that: `core.checks` makes clean arrays of them.

`allowed`      what an argument may be: a test, and words for what passes it
`annotations`  what an annotation allows
`kinds`        annotations that tell a range, or names of their own
`checked`      the decorator of public functions, and of classes that a user makes
"""
