from .stage import Screen as Screen, Stage as Stage
