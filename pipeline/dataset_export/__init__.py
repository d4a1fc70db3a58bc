"""A database in the forms that other programs load: mjlab and BeyondMimic, GMR, LeRobot, Rerun."""

from pipeline.dataset_export.export import FORMATS, NotInstalledError, export_clips, export_database, output_file

__all__ = ["FORMATS", "NotInstalledError", "export_clips", "export_database", "output_file"]
