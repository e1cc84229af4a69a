"""Figures like those of the paper, one function each, all of them by `draw_figures`.

The public names are loaded when they are first used; they stand in the stub beside this file, `__init__.pyi`.

`style`     sizes, fonts and colors that all figures share
`plots`     of numbers: the flattened scan, the height map, the histogram of the CT
`pictures`  of surfaces: the scan, a tile, four tiles, a cross-section, the whole leaf
`draw`      all of them into a folder, with a page of captions
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
