"""Products of features summed over runs: decimation, sums, groups, reduction."""
