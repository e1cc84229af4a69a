"""Long work that goes on where a run of it was stopped.

`parts`   finished parts of a result beside its name, known by context
`blocks`  finished blocks of a step, in their order
"""
