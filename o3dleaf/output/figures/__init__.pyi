# The public names of figures, in the order of the paper; `__init__.py` reads this file and loads them lazily.
from .draw import Drawn as Drawn
from .draw import draw_figures as draw_figures
from .pictures import scan_picture as scan_picture
from .plots import flattened_scan as flattened_scan
from .plots import height_map as height_map
from .plots import histogram as histogram
from .pictures import one_tile as one_tile
from .pictures import four_tiles as four_tiles
from .pictures import cross_section as cross_section
from .pictures import whole_leaf as whole_leaf
from .style import FigureSheet as FigureSheet
