"""The Fit tab: moment arms, losses and delays of the runs on air, and how each came about."""
