"""The project's folders and files, for the graph, the commands and the curation page."""

from pipeline.project.project import DEFAULT_ROBOT, PROJECT, Project, find_project
