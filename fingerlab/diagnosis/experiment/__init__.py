"""The run that would separate what the data leave open."""
