"""A surface from any oriented cloud: the cloud prepared, a field fitted, its surface followed, trimmed and cleaned.

`fit` turns an oriented cloud into a field, `reconstruct` is the whole job, one function a step.
"""
