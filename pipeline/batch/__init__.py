"""A stage over many clips: what is known already is taken from the memo, the rest runs in parallel processes."""

from pipeline.batch.manifest import Manifest
from pipeline.batch.pool import ClipPool
from pipeline.batch.rows import Entry, Judged
from pipeline.batch.run import run_files, run_stage
from pipeline.batch.shard import Rows, changed
from pipeline.batch.shard_answers import Stage
from pipeline.batch.store import Store
