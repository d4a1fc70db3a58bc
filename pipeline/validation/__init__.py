"""The protocol that evaluates a policy: cells, figures, bars, one verdict with every reason."""
