"""Figures like those of the paper, one function each, all of them by `draw_figures`.

`style`     sizes, fonts and colors that all figures share
`plots`     of numbers: the flattened scan, the height map, the histogram of the CT
`pictures`  of surfaces: the scan, a tile, four tiles, a cross-section, the whole leaf
`draw`      all of them into a folder, with a page of captions
"""

from o3dleaf.output.figures.pictures import cross_section as cross_section
from o3dleaf.output.figures.pictures import four_tiles as four_tiles
from o3dleaf.output.figures.pictures import one_tile as one_tile
from o3dleaf.output.figures.pictures import scan_picture as scan_picture
from o3dleaf.output.figures.pictures import whole_leaf as whole_leaf
from o3dleaf.output.figures.plots import flattened_scan as flattened_scan
from o3dleaf.output.figures.plots import height_map as height_map
from o3dleaf.output.figures.plots import histogram as histogram
from o3dleaf.output.figures.style import Sheet as Sheet
