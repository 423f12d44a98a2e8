"""The check of a rig on its first day, on the bench that records: what is to be driven is confirmed first."""
