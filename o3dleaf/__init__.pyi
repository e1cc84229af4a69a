# The public names, in the order of the story; `__init__.py` reads this file and loads them lazily.
from .errors import IllPosedError as IllPosedError
from .errors import InputError as InputError
from .errors import MemoryBudgetError as MemoryBudgetError
from .errors import O3DLeafError as O3DLeafError
from .errors import ReconstructionError as ReconstructionError
from .errors import UnitError as UnitError
from .field import Field as Field
from .parallel import get_num_threads as get_num_threads
from .parallel import set_num_threads as set_num_threads

__version__: str
