"""The expert motion database for adversarial imitation: its frames, files and licences."""

from pipeline.expert.frames import Column, columns, expert_frames
from pipeline.expert.history import DatabaseLossError, DatabaseSettings
from pipeline.expert.licence import LicenceClass, classify_licence, strictest
from pipeline.expert.read import DatabaseError, check_database, read_database
from pipeline.expert.write import ExpertEntry, NoClipsError, StoredClip, write_database
