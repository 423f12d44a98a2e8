"""The Acquire tab: drive the rig, see it, record it."""
