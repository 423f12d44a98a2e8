"""A bench that can be driven and recorded: loop, guardian and recorder, and the face that is asked."""
