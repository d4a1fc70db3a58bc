"""Export of a database to the formats of other programs: mjlab and BeyondMimic, GMR, LeRobot, Rerun."""

from pipeline.dataset_export.export import FORMATS, export_clips, export_database
