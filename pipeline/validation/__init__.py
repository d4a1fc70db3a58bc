"""The validation protocol of a policy: cells, figures, bars (thresholds), one verdict with every reason."""
