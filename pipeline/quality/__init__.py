"""Motion metrics used by several stages, each with definition and source."""
