"""Job that processes the motions of one source again; each source is a partition.

The assets themselves have no partitions: weights and the selection of windows depend on all sources, so a database of
some partitions would differ, and `--select expert_db` would need a partition. A shard of a manifest belongs to one
source; this job takes the shards of other sources from the cache.
"""

import dagster as dg

from assets.bootstrap import rerun_stages
from assets.report import as_failure, stop
from assets.sources import SOURCES, SOURCES_NAME
from pipeline.batch.again import working_again_on
from pipeline.errors import UnknownNameError
from pipeline.project import PROJECT


@dg.op(
    out={},
    required_resource_keys={"io_manager"},
    description="Runs every stage again on all clips of the source, although their results are cached.",
)
def process_source_again(context: dg.OpExecutionContext):
    """Materialize all stages and databases; the clips of the partition's source are processed again."""
    source, known = context.partition_key, context.instance.get_dynamic_partitions(SOURCES_NAME)
    if source not in known:  # Dagster does not validate a partition that is given as a tag
        stop(str(UnknownNameError("source", source, list(known))))
    with as_failure(), working_again_on([f"{source}/"]):
        rerun_stages(context.instance, context.run, PROJECT, context.log)


@dg.job(
    name="rerun_source",
    partitions_def=SOURCES,
    description="Processes the motions of one source (partition) again, from the catalogue to the databases.",
)
def rerun_source() -> None:
    process_source_again()
