"""Limits on the files that sonata2d reads, checked before anything is built from their content.

All are far beyond sensible files. A limit in bytes bounds memory only together with the others: one byte of JSON can
become 30 bytes of Python objects, and one number in a file can declare an array of any size.
"""

MAX_FILE_BYTES = 1 << 30  # of one file, stored or unpacked: more than an hour with a hundred pedestrians
MAX_SCENARIO_BYTES = 64_000_000
MAX_YAML_BYTES = 2_000_000  # of a scenario: YAML takes 10 s for each megabyte, JSON a hundredth of that
MAX_TOML_BYTES = 50_000  # of a scenario: a dotted key of this length takes more than a second, and time is quadratic
MAX_TRACKS_BYTES = 1 << 27  # of recorded tracks: a day of video with dozens of people
MAX_MATRIX_BYTES = 10_000  # of a homography
MAX_WEIGHTS_BYTES = 1 << 26  # of all arrays of a network

# A compressed file may unpack to the larger one of these two. Episodes compress to between 1/3 and 1/30 of their size.
# A trusted file beyond that can be unpacked with gzip or zstd: the ratio is a limit for compressed files only.
MAX_UNPACKED_WITHOUT_RATIO = 1 << 23
MAX_UNPACKED_RATIO = 64
MAX_ARCHIVE_WITHOUT_RATIO = 1 << 26  # of `.npz` files, whose arrays take less memory than JSON of the same size

MAX_DEPTH = 200  # of the values in episodes that may have any structure, such as labels
MAX_COUNT = 10_000  # of one kind of entity in a scenario
MAX_ROBOTS = 256  # of a scene; each keeps a list of all that can come near
MAX_SCENARIO_DEPTH = 32
MAX_SCENARIO_KEYS = 1000  # of one mapping
MAX_NAME = 255  # characters of the name of a scenario
MAX_SCENARIO_VALUES = 1_000_000  # with all that aliases repeat

# Cells of one imported episode: each tick has one for each pedestrian, absent pedestrians included, and as much as
# `CELLS_OF_FRAME` of its own. A cell takes 300 bytes of memory. Tracks may have the larger one of the first two
# limits, but never more than the third. The recording `hotel` of ETH has 740 000 cells, 114 for each observation.
CELLS_OF_FRAME = 20
MAX_CELLS_WITHOUT_RATIO = 1_400_000
MAX_CELLS_PER_OBSERVATION = 100
MAX_CELLS = 20_000_000
MAX_ID = 1 << 53  # of pedestrians, objects and groups: exact also in programs that hold all numbers as double
MAX_TRACK_POINTS = 1_000_000  # of one pedestrian of a scenario, interpolated at the ticks: more than a day at 0.1 s
MAX_PERSON_SPEED = 8.0  # m/s, in recorded tracks: people do not run faster, so that a faster step is an error
MAX_ROWS = 200_000  # of one kind in an observation, as files of policies ask for them
MAX_OBSERVATION = 20_000_000  # numbers of several observations together
MAX_GRID_CELLS = 4000  # per side of an occupancy grid
MAX_SUBSTEPS = 1000  # physics steps of one tick, and iterations of the contact solver
