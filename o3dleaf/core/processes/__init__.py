"""Calls in other processes, which may die.

`light_imports`  a start without what is not needed
`child_process`  a call in a process of its own
`cluster`        calls on the workers of a Dask cluster
`spread`         blocks of one job on such workers, known by context
"""
