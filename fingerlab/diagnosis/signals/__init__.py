"""From a run's channels to the motion that the equations see: filters, segments, conditions."""
