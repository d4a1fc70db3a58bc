"""Run a stage over many clips: known results come from the memo, the others are computed in parallel processes."""

from pipeline.batch.manifest import Manifest
from pipeline.batch.pool import ClipPool
from pipeline.batch.rows import Entry, Judged
from pipeline.batch.run import run_files, run_stage
from pipeline.batch.shard import Rows, changed
from pipeline.batch.shard_answers import Stage
from pipeline.batch.store import Store
