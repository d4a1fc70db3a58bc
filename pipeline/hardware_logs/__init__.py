"""Logs of a robot (MCAP, sqlite3 bags): read with every damage said, written for virtual robots."""
