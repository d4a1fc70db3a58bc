"""The robot in DART, an engine with hard contacts."""
