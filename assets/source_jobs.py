"""The job that works on the motions of one source again, a partition a source.

The assets themselves have no partitions: weights and the choice of windows are made over all sources, so a database of
some partitions would be another one, and `--select expert_db` would need a partition. Their manifests are in shards of
one source each: of what this job works on, the shards of other sources are recalled as they are.
"""

import dagster as dg

from assets.bootstrap import work_again
from assets.report import as_failure, stop
from assets.sources import SOURCES, SOURCES_NAME
from pipeline.batch.again import working_again_on
from pipeline.errors import UnknownNameError
from pipeline.project import PROJECT


@dg.op(
    out={},
    required_resource_keys={"io_manager"},
    description="Every stage works again on all clips of the source, although their results are known.",
)
def work_on_source_again(context: dg.OpExecutionContext):
    """Run all stages and the databases, with the clips of the partition's source worked on again."""
    source, known = context.partition_key, context.instance.get_dynamic_partitions(SOURCES_NAME)
    if source not in known:  # a run that is launched by its tag is not checked by Dagster
        stop(str(UnknownNameError("source", source, list(known))))
    with as_failure(), working_again_on([f"{source}/"]):
        work_again(context.instance, context.run, PROJECT, context.log)


@dg.job(
    name="rerun_source",
    partitions_def=SOURCES,
    description="Work again on the motions of one source (a partition), from the catalogue to the databases.",
)
def rerun_source() -> None:
    work_on_source_again()
