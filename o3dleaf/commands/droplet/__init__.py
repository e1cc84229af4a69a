"""A droplet on a leaf: its case, and its run.

`case_options`  options of `o3dleaf export --for droplet`
`run`           `o3dleaf droplet`
"""
