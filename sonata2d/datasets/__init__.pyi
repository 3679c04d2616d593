from .card.write import write_card as write_card
from .check.episodes import Problem as Problem
from .check.replay import branch as branch
from .check.verification import verify as verify
from .generate.run import generate_dataset as generate_dataset
from .hub import push_dataset as push_dataset
from .manifest.names import CROISSANT as CROISSANT, MANIFEST as MANIFEST, METRICS as METRICS
from .manifest.rows import files_of as files_of, read_manifest as read_manifest
from .tables import write_tables as write_tables
from .transforms.merge import merge_datasets as merge_datasets
from .transforms.mirror import (
    mirror_dataset as mirror_dataset,
    mirror_file as mirror_file,
    mirrored as mirrored,
    twist_image as twist_image,
)
from .transforms.split import split_dataset as split_dataset
