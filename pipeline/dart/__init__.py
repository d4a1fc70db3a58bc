"""The robot in DART, which has hard contacts."""
