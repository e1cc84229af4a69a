# The public names of pictures, in the order of their story; `__init__.py` reads this file and loads them lazily.
from .camera import Camera as Camera
from .camera import View as View
from .maps import render_distortion as render_distortion
from .maps import render_residuals as render_residuals
from .leaf_picture import render_pieces as render_pieces
from .picture import Inset as Inset
from .picture import render as render
from .pick import pick_midrib as pick_midrib
from .pick import write_midrib as write_midrib
from .points import Points as Points
from .scene import Scalars as Scalars
from .window import show as show
