"""A database in the forms that other programs load: mjlab and BeyondMimic, GMR, LeRobot, Rerun."""

from pipeline.dataset_export.export import FORMATS, export_clips, export_database
