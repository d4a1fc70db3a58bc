"""The software-defined assets: each reads, calls a pure function of `pipeline`, writes and reports."""
