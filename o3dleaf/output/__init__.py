"""Output: files for other programs, pictures, reports, figures.

`export`       meshes, particles and distances for other programs
`droplet`      a droplet on the leaf, for OpenFOAM, and its run
`static_drop`  a drop at rest, by Surface Evolver
`view`         pictures and the interactive window
`report`       reports on a mesh, a file or a run
`figures`      figures like the paper's
"""

import lazy_loader

# The namespaces o3l.view and o3l.figures, and nothing heavier before they are used.
__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, ["figures", "view"])
