from .stage import Screen as Screen
from .stage import Stage as Stage
