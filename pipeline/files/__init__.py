"""File access without clip types: atomic writes, digests, blob store, arrays, settings."""
