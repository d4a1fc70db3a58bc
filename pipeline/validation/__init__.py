"""The protocol a policy is judged by: cells, figures, bars, one verdict with every reason."""
